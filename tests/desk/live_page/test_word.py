"""The word of the page's buttons cannot be guessed: it is long, tries are few, and somebody hears of them."""

from observer_rt.desk.live_page.missing.word import LONGEST_DELAY, SecretWord, WordResult


def test_wrong_words_are_few_however_many_are_said_and_are_told() -> None:
    told: list[str] = []
    clock = [0.0]
    word = SecretWord(told.append, lambda: clock[0])
    assert len(word.text) >= 22  # 128 bits
    results = []
    for _ in range(60_000):  # a thousand a second
        clock[0] += 1e-3
        results.append(word.check("guessed", "192.0.2.7"))
    assert results[:500].count(WordResult.WRONG) == 1
    assert 3 <= results.count(WordResult.WRONG) <= 12
    assert 1 <= len(told) <= 4
    assert "192.0.2.7" in told[0]


def test_the_right_word_is_refused_for_a_while_and_then_ends_the_delay() -> None:
    clock = [0.0]
    word = SecretWord(lambda _: None, lambda: clock[0])
    assert word.check(word.text, None) is WordResult.RIGHT
    for _ in range(10):
        clock[0] += LONGEST_DELAY
        assert word.check("guessed", None) is WordResult.WRONG
    assert word.check(word.text, None) is WordResult.TOO_EARLY
    clock[0] += LONGEST_DELAY
    assert word.check(word.text, None) is WordResult.RIGHT
    assert word.check("guessed", None) is WordResult.WRONG
    clock[0] += 0.5
    assert word.check(word.text, None) is WordResult.RIGHT
