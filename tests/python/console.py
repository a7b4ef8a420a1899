"""What a command says."""


def assert_one_line_of_error(capsys, message):
    """Assert that a message is in the one line that was said, on stderr."""
    shown = capsys.readouterr()
    assert shown.out == ""
    assert message in shown.err
    assert shown.err.count("\n") == 1
