"""Limit of BLAS to one thread."""

from threadpoolctl import threadpool_info, threadpool_limits

from mvpose.threads import one_thread


def threads():
    return [library["num_threads"] for library in threadpool_info()]


def test_only_the_last_exit_lifts_the_limit():
    """The order is that of two threads that estimate at the same time."""
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
