"""Who of several daemons speaks: every row of the table in `fusiond.service.election`."""

from __future__ import annotations

import sys

import pytest

from fusiond.service.election import Election, Member, Move
from fusiond.service.group import PULSES
from fusiond.service.members import member_of, token_of

LIMIT, SETTLE, LOOK = 1000, 600, 50
ACTIVE = Member(0, "a", 7)


class Standby:
    """A standby of some rank, looked at every `LOOK`; the first of its life is at 0."""

    def __init__(self, rank=1):
        self.election = Election(rank, f"rank{rank}", LIMIT, SETTLE)
        self.now = 0

    def look(self, members, signs=()):
        self.now += LOOK
        return self.election.look(self.now, members, signs)

    def until(self, move, members, signs=(), longest=10 * LIMIT):
        """Time until it makes a move, None where it does not."""
        began = self.now
        while self.now < began + longest:
            if self.look(members, signs) is move:
                return self.now - began
        return None


@pytest.fixture
def warm():
    """A standby that has followed an active for longer than the limit."""
    standby = Standby()
    assert standby.until(Move.TAKE_OVER, [ACTIVE], ["a"], 2 * LIMIT) is None
    return standby


def test_a_standby_of_a_living_active_stays(warm):
    assert warm.until(Move.TAKE_OVER, [ACTIVE], ["a"]) is None


def test_a_token_that_goes_makes_the_first_in_rank_take_over_at_once(warm):
    assert warm.look([Member(2, "c")]) is Move.TAKE_OVER
    assert warm.election.cause == "gone"


def test_the_second_in_rank_leaves_it_to_the_first_for_one_limit(warm):
    better = Member(0, "b")
    assert LIMIT <= warm.until(Move.TAKE_OVER, [better]) <= LIMIT + 2 * LOOK


def test_an_active_without_a_sign_of_life_is_replaced_after_the_limit(warm):
    passed = warm.until(Move.TAKE_OVER, [ACTIVE])
    assert LIMIT - LOOK <= passed <= LIMIT + LOOK
    assert warm.election.cause == "silent"


def test_signs_of_life_of_somebody_else_do_not_count(warm):
    assert warm.until(Move.TAKE_OVER, [ACTIVE], ["c"]) is not None


@pytest.mark.parametrize("rank", [0, 1, 2])
def test_whoever_starts_alone_waits_until_links_are_made_and_half_as_long_for_each_rank(rank):
    passed = Standby(rank).until(Move.TAKE_OVER, [])
    assert passed == pytest.approx(SETTLE + rank * SETTLE // 2, abs=2 * LOOK)


def test_an_active_is_joined_whatever_its_rank():
    assert Standby(0).until(Move.TAKE_OVER, [Member(1, "b", 7)], ["b"]) is None


def test_who_was_away_itself_takes_nobodys_absence_for_evidence(warm):
    warm.now += 2 * LIMIT
    assert warm.look([]) is Move.STAY
    assert warm.until(Move.TAKE_OVER, [], longest=SETTLE - LOOK) is None
    warm.now += 2 * LIMIT
    assert warm.look([ACTIVE]) is Move.STAY
    assert LIMIT - LOOK <= warm.until(Move.TAKE_OVER, [ACTIVE]) <= LIMIT + LOOK


def active(rank=0, epoch=7):
    standby = Standby(rank)
    standby.look([])
    standby.election.epoch = epoch
    return standby


@pytest.mark.parametrize(
    ("other", "steps_down"),
    [
        (Member(1, "b", 8), True),
        (Member(1, "b", 6), False),
        (Member(2, "b", 7), False),
        (Member(0, "b", 7), True),
        (Member(0, "b"), False),
        (Member(0, "b", sys.maxsize, pulses=False), True),
    ],
    ids=[
        "later epoch",
        "earlier epoch",
        "same epoch, higher rank",
        "same epoch, lower rank",
        "standby",
        "alone",
    ],
)
def test_of_two_actives_one_steps_down(other, steps_down):
    """The one with the earlier epoch; of equal ones the one with the higher rank."""
    mine = active(rank=1)
    assert (mine.look([other]) is Move.STEP_DOWN) is steps_down


@pytest.mark.parametrize("epochs", [(7, 8), (8, 7), (7, 7)])
@pytest.mark.parametrize("ranks", [(0, 1), (1, 0)])
def test_of_two_actives_exactly_one_steps_down(epochs, ranks):
    both = [Member(rank, name, epoch) for rank, name, epoch in zip(ranks, "ab", epochs, strict=True)]
    moves = []
    for me in both:
        mine = active(me.rank, me.epoch)
        mine.election.id = me.id
        moves.append(mine.look(both))
    assert sorted(move.value for move in moves) == ["stay", "step down"]


def test_an_active_that_was_held_up_steps_down_where_others_are_there():
    alone, watched = active(), active()
    for one in (alone, watched):
        one.now += SETTLE
    assert alone.look([]) is Move.STAY
    assert watched.look([Member(1, "b")]) is Move.STEP_DOWN


def test_an_active_that_was_held_up_steps_down_where_others_were_there_before():
    """Their tokens are gone with its links, which they have cut: they may have taken over."""
    mine = Standby(0)
    mine.election.epoch = 9
    assert mine.look([Member(1, "b")]) is Move.STAY
    mine.now += mine.election.term_ns
    assert mine.look([]) is Move.STEP_DOWN


def test_an_active_that_was_alone_stays_whatever_holds_it_up():
    mine = Standby(0)
    mine.election.epoch = 9
    assert mine.look([Member(1, "b")]) is Move.STAY
    assert mine.look([]) is Move.STAY
    mine.now += 10 * LIMIT
    assert mine.look([]) is Move.STAY


@pytest.mark.parametrize("member", [Member(3, "c0ffee"), Member(0, "c0ffee", 1_700_000_000_000)])
def test_a_token_says_who_it_is(member):
    assert member_of(f"fusiond/bench/{token_of(member)}") == member


@pytest.mark.parametrize("key", ["x/alive/fusion/a-b-c", "x/alive/standby/c0ffee", "x/alive/node/1-2", "x"])
def test_other_tokens_are_nobodys(key):
    assert member_of(key) is None


def test_a_daemon_outside_of_any_group_has_the_strongest_claim():
    alone = member_of("x/alive/fusion/c0ffee")
    assert alone.claim > Member(0, "a", 1 << 60).claim
    assert not alone.pulses


@pytest.mark.parametrize(("limit", "settle"), [(1000, 600), (300, 1000), (1000, 1000)])
def test_a_lease_is_over_before_others_take_its_holder_for_gone(limit, settle):
    """Others count from its last sign of life, up to a tenth of a term before the lease was renewed."""
    holder = Election(0, "a", limit, settle)
    assert holder.term_ns + holder.term_ns / PULSES < min(limit, settle)
