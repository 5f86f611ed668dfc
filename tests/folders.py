"""Folders as values that compare."""


def contents(folder):
    """The bytes of each file in a folder, by the file's path in it."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
