"""Releases below a prefix, without systemd."""

import subprocess


class Prefix:
    """A folder with releases."""

    def __init__(self, path, alone):
        self.path, self._alone = path, alone

    def install(self, bundle, *options):
        return self._run(*self.installing(bundle), *options)

    def installing(self, bundle):
        """The command that installs a bundle."""
        return [*map(str, self._alone), str(bundle / "install.sh"), "--prefix", str(self.path), "--no-systemd"]

    def deploy(self, *words):
        return self._run(*self._alone, self.path / "vm-deploy", *words)

    def _run(self, *words):
        return subprocess.run(list(map(str, words)), capture_output=True, text=True, timeout=300)

    def link(self, name):
        """The release that a link names; None without the link."""
        path = self.path / name
        return path.readlink().name if path.is_symlink() else None

    def releases(self):
        return {each.name for each in (self.path / "releases").iterdir()}
