"""The catalogue, its tests and its page belong together."""

import re

import pictures
from catalogue import CASES, ROOT, exists, file_of, hard_tests

import page


def test_every_case_has_tests_that_exist():
    assert [(case.id, test) for case in CASES for test in case.tests if not exists(test)] == []
    assert all(case.tests for case in CASES)


def test_every_test_belongs_to_a_case():
    assert hard_tests() - {test for case in CASES for test in case.tests} == set()


def test_each_case_says_in_sentences_what_goes_wrong_and_what_is_promised():
    for case in CASES:
        assert case.what.endswith(".") and case.promise.endswith("."), case.id


def test_the_page_is_that_of_the_catalogue():
    assert page.PAGE.read_text(encoding="utf-8") == page.page_text()


def test_margins_are_those_of_the_catalogue():
    """No case is left of an older catalogue, every margin was kept, and the commit that measured
    them has no changes beside it."""
    assert re.fullmatch("[0-9a-f]{8,}", page.stored()["commit"])
    assert set(page.margins()) <= {case.id for case in CASES}
    worst = [share for of in page.margins().values() for share, _ in of.values()]
    assert len(worst) > 60 and max(worst) <= 1.0


def test_margins_of_the_m7_come_from_tests_that_run_there():
    on_m7 = re.compile(r"\.everywhere\b|margins\.of\(|same_everywhere|\"M7\"")
    for case in CASES:
        if "M7" in page.margins().get(case.id, {}):
            texts = [(ROOT / file_of(test)).read_text(encoding="utf-8") for test in case.tests]
            assert any(on_m7.search(text) for text in texts), case.id


def test_pictures_exist():
    for case in CASES:
        if case.picture is not None:
            assert case.picture in pictures.DRAWN and (page.PICTURES / case.picture).is_file()
