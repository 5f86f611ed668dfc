"""A set of pictures on disk: rendering, writing, checking, reports and contact sheets."""
