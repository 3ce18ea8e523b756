"""One thread of BLAS within a block, and as many as before after it."""

from threadpoolctl import ThreadpoolController

from isp.blas import one_thread


def threads() -> set[int]:
    return {library["num_threads"] for library in ThreadpoolController().select(user_api="blas").info()}


def test_blas_has_one_thread_within_the_block_alone() -> None:
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        with one_thread():
            assert threads() == {1}
        assert threads() == {2}
