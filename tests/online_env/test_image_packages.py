"""Images of the desktop: versions and needs of packages, archives and their checks."""

import errno
import hashlib
import io
import lzma
import os
import tarfile

import pytest

from hijack_data.errors import StorageError
from hijack_data.file_io import unwritable
from online_env.embedded.image import build, debian, guest_packages, sources, unprivileged_chroot
from online_env.embedded.image.manifest import Manifest, Pin
from online_env.errors import DesktopImageError

STANZAS = """Package: app
Version: 1.0
Depends: lib (>= 1), shell | other-shell, mail-agent, helper:any
SHA256: 11
Size: 5
Filename: pool/app.deb

Package: lib
Version: 1.0
SHA256: 12
Size: 5
Filename: pool/lib.deb

Package: lib
Version: 1.10
SHA256: 13
Size: 5
Filename: pool/lib2.deb
Description: words
 and more: words

Package: helper
Version: 1
Pre-Depends: other-shell
SHA256: 14
Size: 5
Filename: pool/helper.deb

Package: shell
Version: 1
SHA256: 15
Size: 5
Filename: pool/shell.deb

Package: other-shell
Version: 1
Priority: required
SHA256: 16
Size: 5
Filename: pool/other.deb

Package: exim
Version: 1
Provides: mail-agent (= 1), smtp
SHA256: 17
Size: 5
Filename: pool/exim.deb
"""


# deb-version(7), and what `dpkg --compare-versions` says of each.
@pytest.mark.parametrize(
    ("low", "high"),
    [
        ("1.0~rc1", "1.0"),
        ("1.0~~", "1.0~"),
        ("1.0", "1.0a"),
        ("1.0a", "1.0+b"),
        ("1.2", "1.10"),
        ("10", "1:2"),
        ("1.0-1", "1.0-1+deb12u1"),
        ("1.0-1~deb12u1", "1.0-1"),
        ("1.0", "1.0-1"),
        ("1.0-2", "1.0.1-1"),
        ("1.09", "1.010"),
    ],
)
def test_versions_are_in_debians_order(low, high):
    assert debian.compare(low, high) == -1
    assert debian.compare(high, low) == 1
    assert debian.compare(low, low) == 0


def test_equal_versions_are_written_in_several_ways():
    assert debian.compare("1.0", "0:1.0-0") == 0
    assert debian.compare("1.01", "1.1") == 0


def test_a_closure_takes_what_is_there_anyway_and_the_newest():
    index = debian.PackageIndex.of(debian.parse(STANZAS, "https://x.test"))
    entries = {package.name: package for package in index.closure(["app"])}
    # `helper` needs the second of the shells, so the first is not wanted
    assert set(entries) == {"app", "lib", "helper", "other-shell", "exim"}
    assert entries["lib"].version == "1.10"
    assert entries["lib"].url == "https://x.test/pool/lib2.deb"
    assert index.base() == ["other-shell"]


def test_a_choice_that_nothing_settles_takes_the_first():
    text = STANZAS.replace(", helper:any", "")
    index = debian.PackageIndex.of(debian.parse(text, ""))
    assert "shell" in {package.name for package in index.closure(["app"])}


def test_what_nothing_provides_is_named():
    index = debian.PackageIndex.of(debian.parse(STANZAS, ""))
    with pytest.raises(DesktopImageError, match="no package provides nowhere"):
        index.closure(["app", "nowhere"])


def test_a_stanza_that_lacks_a_field_is_named():
    with pytest.raises(DesktopImageError, match=r"'app' lacks a field.*SHA256"):
        debian.parse(STANZAS.replace("SHA256: 11\n", ""), "https://x.test")


def test_sources_of_the_machine_in_both_formats(tmp_path):
    (tmp_path / "sources.list.d").mkdir()
    (tmp_path / "sources.list").write_text(
        "# deb https://off.test bookworm main\n"
        "deb [arch=amd64 signed-by=/nowhere] https://one.test/debian/ bookworm main # words\n"
        "deb-src https://src.test bookworm main\n"
        "deb https://newer.test trixie main\n"
        "deb https://part.test bookworm contrib\n"
        "deb cdrom:[Debian]/ bookworm main\n"
    )
    (tmp_path / "sources.list.d/more.sources").write_text(
        "Types: deb\nURIs: https://two.test\nSuites: bookworm bookworm-updates\n"
        "Components: main\n\n"
        "# the one below\nTypes: deb\nURIs:\n https://three.test\n# and\n https://four.test\n"
        "suites: bookworm\nComponents:\n main contrib\n\n"
        "Types: deb\nEnabled: no\nURIs: https://no.test\nSuites: bookworm\nComponents: main\n"
    )
    (tmp_path / "sources.list.d/old.bak").write_text("deb https://bak.test bookworm main\n")
    values = [(source.url, source.suite) for source in sources.from_machine(tmp_path)]
    assert values == [
        ("https://one.test/debian", "bookworm"),
        ("https://two.test", "bookworm"),
        ("https://two.test", "bookworm-updates"),
        ("https://three.test", "bookworm"),
        ("https://four.test", "bookworm"),
    ]


def test_a_machine_of_another_distribution_is_told_what_to_do(tmp_path):
    (tmp_path / "sources.list").write_text("deb https://archive.test noble main\n")
    with pytest.raises(DesktopImageError, match="--mirror URL"):
        sources.from_machine(tmp_path)


def test_wrong_mirrors_are_refused(tmp_path):
    with pytest.raises(DesktopImageError, match="must be a URL"):
        sources.from_mirror("ftp://x.test")
    with pytest.raises(DesktopImageError, match="no such file"):
        sources.from_mirror("https://x.test", keyring=tmp_path / "keys.gpg")


@pytest.fixture
def archive(tmp_path):
    """An archive of three suites in a folder, without a signature."""
    sources_of_it = sources.from_mirror(f"file://{tmp_path}", f"file://{tmp_path}")
    for source in sources_of_it:
        write_suite(tmp_path, source.suite, STANZAS)
    return [sources.AptSource(s.url, s.suite, None) for s in sources_of_it]


def write_suite(top, suite, text, listed=None):
    folder = top / "dists" / suite
    (folder / "main/binary-amd64").mkdir(parents=True, exist_ok=True)
    data = lzma.compress(text.encode())
    (folder / "main/binary-amd64/Packages.xz").write_bytes(data)
    digest = listed or hashlib.sha256(data).hexdigest()
    (folder / "InRelease").write_text(
        f"Suite: {suite}\nSHA256:\n {digest} 1 main/binary-amd64/Packages.xz\n"
    )


@pytest.fixture(autouse=True)
def no_pauses(monkeypatch):
    monkeypatch.setattr(sources.time, "sleep", lambda seconds: None)


def test_an_archive_without_a_signature_is_refused_unless_it_is_asked_for(archive):
    with pytest.raises(DesktopImageError, match="--unsigned"):
        sources.read(archive, "amd64")
    index, trust = sources.read(archive, "amd64", unsigned=True)
    assert trust == "none"
    assert index.best["lib"].version == "1.10"


def test_an_archive_that_another_one_signed_is_refused(archive, tmp_path):
    keys = tmp_path / "keys.gpg"
    keys.write_bytes(b"")
    signed = [sources.AptSource(archive[0].url, archive[0].suite, keys)]
    with pytest.raises(DesktopImageError, match="its signature is not one of"):
        sources.read(signed, "amd64")


def test_an_index_that_was_changed_is_refused(archive, tmp_path):
    write_suite(tmp_path, "bookworm", STANZAS, "0" * 64)
    with pytest.raises(DesktopImageError, match=r"Packages\.xz.*SHA-256"):
        sources.read(archive, "amd64", unsigned=True)
    with pytest.raises(DesktopImageError, match="lists no main/binary-arm64"):
        sources.read(archive, "arm64", unsigned=True)


def test_no_network_names_what_would_be_fetched(tmp_path):
    nowhere = [sources.AptSource(f"file://{tmp_path}/none", "bookworm", None)]
    with pytest.raises(DesktopImageError, match=r"none/dists/bookworm/InRelease.*a network"):
        sources.read(nowhere, "amd64", unsigned=True)


def package_of(top, data=b"package"):
    (top / "pool").mkdir(exist_ok=True)
    (top / "pool/app.deb").write_bytes(data)
    digest = hashlib.sha256(b"package").hexdigest()
    return debian.Package("app", "1", digest, 7, f"file://{top}/pool/app.deb")


def test_packages_are_fetched_once_and_checked(tmp_path):
    output = []
    package = package_of(tmp_path)
    folder = tmp_path / "kept"
    folder.mkdir()
    paths = sources.fetch_packages([package], folder, output.append)
    assert paths["app"].read_bytes() == b"package"
    (tmp_path / "pool/app.deb").unlink()
    assert sources.fetch_packages([package], folder, output.append) == paths
    assert output[-1] == "1 packages, 0 of them to fetch (0 MB)"
    # one that was damaged on the disk is fetched again
    paths["app"].write_bytes(b"PACKAGE")
    package_of(tmp_path)
    sources.fetch_packages([package], folder, output.append)
    assert paths["app"].read_bytes() == b"package"


def test_a_package_that_was_changed_is_refused_and_not_kept(tmp_path):
    package = package_of(tmp_path, b"changed")
    with pytest.raises(DesktopImageError, match=r"app\.deb.*SHA-256"):
        sources.fetch_packages([package], tmp_path, print)
    assert list(tmp_path.glob("*.deb")) == []


def test_a_full_disk_is_said(tmp_path, monkeypatch):
    def full(path, data):
        raise unwritable(path, OSError(errno.ENOSPC, "No space left on device"))

    monkeypatch.setattr(sources, "write_atomic", full)
    with pytest.raises(StorageError, match="No space left"):
        sources.fetch_packages([package_of(tmp_path)], tmp_path, print)


def deb(names):
    """A package with these files, as deb(5) has it."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:xz") as tar:
        for name in names:
            info = tarfile.TarInfo(name)
            info.size = 1
            info.mtime = 5
            tar.addfile(info, io.BytesIO(b"x"))
    body = data.getvalue()
    result = b"!<arch>\n"
    for name, content in (("debian-binary", b"2.0\n"), ("data.tar.xz", body)):
        result += f"{name:<16}{0:<12}{0:<6}{0:<6}{644:<8}{len(content):<10}`\n".encode()
        result += content + b"\n" * (len(content) % 2)
    return result


def test_a_package_is_unpacked_without_what_no_desktop_needs(tmp_path):
    path = tmp_path / "a.deb"
    kept_paths = {"usr/bin/a", "usr/share/doc/a/copyright", "usr/lib/chromium/locales/en-US.pak"}
    removed_paths = {
        "usr/share/man/man1/a.1",
        "usr/share/doc/a/README",
        "usr/lib/chromium/locales/de.pak",
    }
    path.write_bytes(deb(f"./{name}" for name in kept_paths | removed_paths))
    build.unpack(path, tmp_path / "root")
    files = (p for p in (tmp_path / "root").rglob("*") if p.is_file())
    assert {str(p.relative_to(tmp_path / "root")) for p in files} == kept_paths


@pytest.mark.parametrize("data", [b"", b"no package", deb(["./a"])[:200]])
def test_what_is_no_package_is_refused(tmp_path, data):
    (tmp_path / "a.deb").write_bytes(data)
    with pytest.raises(DesktopImageError, match=r"a\.deb: is no Debian package"):
        build.unpack(tmp_path / "a.deb", tmp_path / "root")


def test_a_manifest_pins_every_package(archive, monkeypatch):
    part = Pin("other-shell", "0.9", "f" * 64)
    pinned = Manifest("bookworm", "amd64", ("core",), "tls", (part,), (), 0, 0, "")
    monkeypatch.setattr(build, "architecture", lambda: "amd64")
    recipe = build.Recipe(("core",), tuple(archive), True, pinned, ("other-shell",))
    with pytest.raises(DesktopImageError, match=r"1 versions.*other-shell 0\.9"):
        build.choose(recipe)
    exact = Manifest(
        "bookworm", "amd64", ("core",), "tls", (Pin("other-shell", "1", "16"),), (), 0, 0, ""
    )
    recipe = build.Recipe(("core",), tuple(archive), True, exact, ("other-shell",))
    assert [package.name for package in build.choose(recipe).all] == ["other-shell"]


def test_owners_cannot_be_changed_in_the_chamber_and_nobody_notices(tmp_path):
    path = tmp_path / "file"
    path.touch()
    child = os.fork()
    if child == 0:
        try:
            unprivileged_chroot.fake_ownership()
            os.chown(path, 12345, 12345)
            os._exit(path.stat().st_uid == 12345)
        finally:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_a_command_that_cannot_run_is_told_with_the_log(tmp_path):
    (tmp_path / "root").mkdir()
    with pytest.raises(DesktopImageError, match=r"the end of .*build\.log"):
        unprivileged_chroot.run(tmp_path / "root", [["true"]], tmp_path / "build.log")


def test_the_guests_packages_are_copied_and_pinned(tmp_path):
    pytest.importorskip("starlette", reason="needs the extra [online]")
    parts = guest_packages.install(tmp_path / "guest")
    names = {part.name for part in parts}
    assert {"starlette", "uvicorn", "python-xlib", "mss", "jeepney"} <= names
    assert (tmp_path / "guest/Xlib/display.py").is_file()
    assert not list((tmp_path / "guest").rglob("*.pyc"))
    assert guest_packages.install(tmp_path / "again") == parts


def test_a_missing_package_of_the_guest_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(guest_packages, "NEEDED", ("no-such-package",))
    with pytest.raises(DesktopImageError, match=r"no-such-package.*\[online\]"):
        guest_packages.install(tmp_path / "guest")
