"""What a misspelt word probably means."""

import pytest

from rudc.hints import did_you_mean, nearest, there_are

KNOWN = ["density", "speed", "mix"]


@pytest.mark.parametrize(
    ("word", "meant"),
    [("densty", "density"), ("sped", "speed"), ("mxi", "mix"), ("colour", None), ("", None), (3, None)],
)
def test_the_nearest_word_is_offered_if_it_is_near(word, meant):
    assert nearest(word, KNOWN) == meant
    assert did_you_mean(word, KNOWN) == (f" (did you mean {meant!r}?)" if meant else "")


def test_all_words_can_be_listed():
    assert there_are("sped", iter(KNOWN)) == " (did you mean 'speed'?); there are: density, speed, mix"
    assert there_are("zzz", dict.fromkeys(KNOWN)) == "; there are: density, speed, mix"
