"""Files of other programs: tar archives and TFRecord files, which vm-train imports."""
