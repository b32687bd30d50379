import os
import signal

import pytest

from services.base.process import interruptible


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_service_with_code_0(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    with pytest.raises(SystemExit) as ended, interruptible():
        os.kill(os.getpid(), number)
        signal.pause()
    assert ended.value.code == 0
    assert signal.getsignal(number) is before
