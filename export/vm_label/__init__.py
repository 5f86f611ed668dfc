"""The program vm-label: a page in the browser where a person judges boxes, which become training data."""
