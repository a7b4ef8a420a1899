import numpy as np
import pytest

from dqslam.io import FileError, find_images, frame_rate, read_frame_times


def touch(folder, *names):
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def names(found):
    return {row: path.name for row, path in found.items()}


def test_names_that_are_times(tmp_path):
    times = np.array([100.0, 100.1, 100.2, 100.3])
    folder = touch(tmp_path / "rgb", "100.002.png", "100.19.png", "100.9.png", "notes.txt")
    assert names(find_images(folder, times)) == {0: "100.002.png", 2: "100.19.png"}


def test_names_that_are_nanoseconds(tmp_path):
    times = np.array([1403636579.7635555, 1403636579.8135555])
    folder = touch(tmp_path, "1403636579763555584.png", "1403636579813555456.png")
    found = names(find_images(folder, times))
    assert found == {0: "1403636579763555584.png", 1: "1403636579813555456.png"}


def test_whole_numbers_are_times_of_poses_at_whole_seconds(tmp_path):
    times = np.array([703.0, 706.0, 711.0])
    folder = touch(tmp_path, "000703.jpg", "000704.jpg", "000711.jpg")
    assert names(find_images(folder, times)) == {0: "000703.jpg", 1: "000704.jpg", 2: "000711.jpg"}


def test_as_many_images_as_poses_come_in_their_order(tmp_path):
    """Ten a second: 000002 is no image at 2 s."""
    times = 0.1 * np.arange(30)
    folder = touch(tmp_path, *(f"{number:06}.png" for number in range(30)))
    assert names(find_images(folder, times)) == {row: f"{row:06}.png" for row in range(30)}


def test_frames_have_a_rate_or_a_table(tmp_path):
    times = 5.0 + 0.1 * np.arange(4)
    folder = touch(tmp_path / "images", "left_51.png", "left_53.png", "other.png")
    rate = find_images(folder, times, frame_rate(10.0))
    assert names(rate) == {1: "left_51.png", 3: "left_53.png"}
    (tmp_path / "frames.csv").write_text("frame,timestamp\n51,5.3\n52,6\n")
    table = find_images(folder, times, read_frame_times(tmp_path / "frames.csv"))
    assert names(table) == {3: "left_51.png"}


def test_a_list_of_images_has_their_times(tmp_path):
    (tmp_path / "rgb.txt").write_text("5.1 rgb/b.png\n5.2 rgb/a.png\n")
    folder = touch(tmp_path / "rgb", "a.png", "b.png")
    found = find_images(folder, 5.0 + 0.1 * np.arange(4), read_frame_times(tmp_path / "rgb.txt"))
    assert names(found) == {1: "b.png", 2: "a.png"}


def test_one_image(tmp_path):
    folder = touch(tmp_path, "0.21.png")
    assert names(find_images(folder, 0.1 * np.arange(4))) == {2: "0.21.png"}


def test_what_cannot_be_told_is_refused(tmp_path):
    times = 0.1 * np.arange(4)
    with pytest.raises(FileError, match="no such folder of images"):
        find_images(tmp_path / "none", times)
    with pytest.raises(FileError, match="holds no images"):
        find_images(touch(tmp_path / "empty", "a.txt"), times)
    few = touch(tmp_path / "few", "000001.png", "000002.png")
    with pytest.raises(FileError, match=r"2 images \(the first is 000001.png\), 4 poses .*--frame"):
        find_images(few, times)
    with pytest.raises(FileError, match="no image is of the time of a pose, by a rate of 0.1 Hz"):
        find_images(few, times, frame_rate(0.1))
