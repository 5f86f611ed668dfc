"""The truth about pictures: objects, uprights and the field, from scene files and masks."""
