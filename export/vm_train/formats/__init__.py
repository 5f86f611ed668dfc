"""Files of other programs: TFRecord files, which it imports, and tar shards, which it writes."""
