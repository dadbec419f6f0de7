"""The licences of packages: what is installed suits, and what does not suit is found."""

import re
import tomllib
from email.message import Message
from importlib.metadata import distribution, distributions
from types import SimpleNamespace

import pytest

from scripts.licences import ALLOWED, STATED, kind_of, stated_licence, table
from tests.cases import ROOT


def package(name, **headers):
    """Return what `importlib.metadata` tells of a package."""
    metadata = Message()
    for header, value in headers.items():
        metadata[header.replace("_", "-")] = value
    return SimpleNamespace(name=name, version="1.0", metadata=metadata)


def test_every_installed_package_has_a_licence_that_suits():
    rows, faults = table(distributions())
    assert len(rows) > 50
    assert faults == []


@pytest.mark.parametrize(
    ("licence", "kind"),
    [
        ("MIT", "permissive"),
        ("BSD-3-Clause AND 0BSD AND MIT AND Zlib AND CC0-1.0", "permissive"),
        ("GPL-3.0-only OR MIT", "permissive"),
        ("MIT AND (MPL-2.0)", "weak copyleft"),
        ("GNU Lesser General Public License v3 or later (LGPLv3+)", "weak copyleft"),
        ("GNU General Public License v2 (GPLv2)", "GPL"),
        ("MIT AND AGPL-3.0-only", "GPL"),
        ("", "unknown"),
        ("Proprietary", "unknown"),
        ("MIT OR Proprietary", "permissive"),
        ("PERMITTED", "unknown"),
    ],
)
def test_a_licence_is_of_one_kind(licence, kind):
    assert kind_of(licence) == kind


def test_expressions_come_before_classifiers_and_classifiers_before_text():
    bsd = "License :: OSI Approved :: BSD License"
    assert stated_licence(package("a", License_Expression="MIT", Classifier=bsd)) == "MIT"
    assert stated_licence(package("a", License="Copyright (c) 2001", Classifier=bsd)) == "BSD License"
    assert (
        stated_licence(package("a", License="ISC\nCopyright", Classifier="License :: OSI Approved")) == "ISC"
    )
    assert stated_licence(package("a", License="UNKNOWN")) == ""


def test_packages_that_do_not_suit_are_named_unless_there_is_a_reason():
    (named, *others) = ALLOWED
    packages = [
        package("strict", License_Expression="GPL-3.0-or-later"),
        package("silent"),
        package(named, License_Expression="GPL-2.0-or-later"),
        *(package(name) for name in STATED),
    ]
    assert others == []
    assert table(packages)[1] == ["silent 1.0: not stated", "strict 1.0: GPL-3.0-or-later"]


# with cadquery, which has an environment of its own, and on Linux on aarch64
ELSEWHERE = {"cadquery", "casadi", "nlopt", "py-lib3mf"}


def test_the_page_of_licences_names_what_the_extras_install_by_the_kind_of_its_licence():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lists = [project["dependencies"]]
    lists += [v for k, v in project["optional-dependencies"].items() if k not in ("peers", "docs", "test")]
    wanted = {re.match(r"[\w-]+", line)[0] for lines in lists for line in lines}
    text = (ROOT / "LICENSES.md").read_text("utf-8").partition("## Installed by the extras")[2]
    named = dict(re.findall(r"^\| ([\w-]+) \| (.*[A-Z].*) \|$", text, re.MULTILINE))
    assert wanted - {"thbcad"} <= set(named)
    installed = {package.name for package in distributions()}
    for package, licence in named.items():
        if package in ELSEWHERE - installed:
            continue
        stated = STATED[package][0] if package in STATED else stated_licence(distribution(package))
        assert kind_of(licence.replace(", with", " AND")) == kind_of(stated), package
