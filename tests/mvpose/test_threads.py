"""BLAS on one thread, for as long as anybody asks for it."""

from threadpoolctl import threadpool_info, threadpool_limits

from mvpose.threads import one_thread


def threads():
    return [library["num_threads"] for library in threadpool_info()]


def test_who_leaves_first_lifts_no_limit_and_who_leaves_last_leaves_it_as_it_was():
    """As two threads do that estimate at once."""
    with threadpool_limits(limits=3):
        before = threads()
        assert max(before) > 1
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        assert set(threads()) == {1}
        first.__exit__(None, None, None)
        assert set(threads()) == {1}
        second.__exit__(None, None, None)
        assert threads() == before
