import numpy as np
import pytest

from dqslam.io import FileError, frame_rate, read_frame_times
from dqslam.io.frames import write_frame_times
from dqslam.io.image_names import image_name


def write(tmp_path, *lines):
    path = tmp_path / "times.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def at(times, *frames):
    return times.at("boxes", np.array(frames), range(1, len(frames) + 1)).tolist()


def test_lines_are_frames_from_0(tmp_path):
    times = read_frame_times(write(tmp_path, "0.0", "1.036e-01", "2.073e-01"))
    assert at(times, 2, 0, 1) == [0.2073, 0, 0.1036]


def test_images_are_found_by_name(tmp_path):
    path = write(tmp_path, "# color images", "1.5 rgb/1.500.png", "1.7 rgb/1.700.png")
    times = read_frame_times(path)
    assert at(times, 0, 1) == [1.5, 1.7]
    assert times.names == {"1.500": 0, "1.700": 1}


def test_csv_names_its_frames(tmp_path):
    times = read_frame_times(write(tmp_path, "frame,timestamp,has_gt", "3,0.5,1", "7,0.9,0"))
    assert at(times, 7, 3) == [0.9, 0.5]


def test_rate():
    assert at(frame_rate(10), 0, 25) == [0, 2.5]
    for rate in (0, -1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="frame rate is .* not positive"):
            frame_rate(rate)


def test_what_is_written_is_read_back(tmp_path):
    frames, times = [5, 2, 5], [1311868164.363181, 0.1, 1311868164.363181]
    write_frame_times(tmp_path / "frames.csv", frames, times)
    assert (tmp_path / "frames.csv").read_text() == "frame,timestamp\n2,0.1\n5,1311868164.363181\n"
    assert at(read_frame_times(tmp_path / "frames.csv"), *frames) == times


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["0", "0.1 a.png"], r"times\.txt:2: 2 fields, not time"),
        (["0 a b"], r"times\.txt:1: 3 fields"),
        (["0", "# no", "nan"], r":3: timestamp is nan, not a finite number below"),
        (["0", "one"], r":2: timestamp is 'one', not a number"),
        (
            ["0", "0.2", "0.1"],
            r":3: frame 2 at 0\.1 s is not later than frame 1 at 0\.2 s \(line 2",
        ),
        (["frame,time", "0,0"], r":1: no column timestamp \(it has: frame, time\)"),
        (["frame,timestamp", "0,0", "1"], r":3: 1 fields, but 2 columns"),
        (["frame,timestamp"], r"holds no rows, only a header"),
        (["frame,timestamp", "0.5,0"], r":2: frame is 0\.5, not a whole number"),
        (["frame,timestamp", "1,0", "0,1"], r":3: frame 0 at 1\.0 s is not later"),
        (["frame,timestamp", '0,"1', "1,2"], r"not CSV"),
        ([""], r"is empty"),
    ],
)
def test_bad_times_are_named(tmp_path, lines, message):
    with pytest.raises(FileError, match=message):
        read_frame_times(write(tmp_path, *lines))


def test_a_frame_without_a_time_is_named_where_it_stands(tmp_path):
    times = read_frame_times(write(tmp_path, "0", "0.1"))
    with pytest.raises(FileError, match=r"boxes:2: .*times\.txt has no time for frame 2"):
        at(times, 1, 2)


def test_image_names():
    assert image_name("rgb/1311868164.363181.png") == "1311868164.363181"
    assert image_name("rgb\\a.b.jpeg") == "a.b"
    assert image_name("12.5") == "12.5"
