"""Files of other programs: TFRecord and tar shards."""
