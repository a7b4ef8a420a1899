"""``dqslam detect``: images and films to boxes, and from images to a map in two commands."""

import contextlib
import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from console import assert_one_line_of_error
from dqslam.cli import main
from dqslam.io import read_detections
from onnx_models import cv2, paint, save_colors, save_constant, write_image
from orbit import CAMERA, NAMES, write_orbit

SIZE = {"width": 100, "height": 60}
CLASSES = ("cup", "book", "lamp")


def boxes_of(number):
    """Two boxes of an image, whole pixels from its corner."""
    return [10 + number, 20, 30 + number, 40], None, [50, 5, 100, 25 + number]


@pytest.fixture
def made(tmp_path):
    """Give a folder of three images, and a detector whose input has bars above and below."""
    folder = tmp_path / "images"
    folder.mkdir()
    for number in range(3):
        write_image(folder / f"{10.5 + 0.25 * number:.2f}.png", paint(boxes_of(number), **SIZE))
    return folder, save_colors(tmp_path / "model.onnx", width=100, height=100, names=CLASSES)


def call(images, model, out, *more):
    return main(
        ["detect", "--images", str(images), "--model", str(model), "--out", str(out), *more]
    )


def test_boxes_to_the_pixel(made, tmp_path, capsys):
    assert call(*made, tmp_path / "boxes.csv") == 0
    shown = capsys.readouterr()
    assert "6 boxes in 3 images: 3 cup, 3 lamp" in shown.out
    assert shown.err == ""
    table = read_detections(tmp_path / "boxes.csv")
    assert table.timestamp.tolist() == [10.5, 10.5, 10.75, 10.75, 11.0, 11.0]
    assert table.frame.tolist() == [0, 0, 1, 1, 2, 2]
    assert table.class_name == ("cup", "lamp") * 3
    assert table.class_id.tolist() == [0, 2] * 3
    expected = [box for number in range(3) for box in boxes_of(number) if box is not None]
    np.testing.assert_array_equal(table.box, np.array(expected) - 0.5)
    assert (
        (tmp_path / "boxes.csv")
        .read_text()
        .startswith(
            "frame,timestamp,image,x1,y1,x2,y2,score,class_id,class_name\n"
            "0,10.5,10.50.png,9.5,19.5,29.5,39.5,1,0,cup\n"
        )
    )


def test_json_and_every(made, tmp_path, capsys):
    assert call(*made, tmp_path / "boxes.csv", "--every", "2", "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert document.pop("seconds") >= 0
    assert document == {
        "written": str(tmp_path / "boxes.csv"),
        "layout": "end-to-end",
        "image_size": [100, 60],
        "images": 2,
        "boxes": 4,
        "classes": {"cup": 2, "lamp": 2},
        "has_times": True,
    }


def test_numbered_images_have_the_times_that_are_given(tmp_path, capsys):
    folder = tmp_path / "images"
    folder.mkdir()
    for number in (8, 10, 9):
        write_image(folder / f"left_{number}.png", paint(boxes_of(number - 8), **SIZE))
    model = save_colors(tmp_path / "model.onnx", **SIZE)
    out = tmp_path / "boxes.csv"
    assert call(folder, model, out) == 0
    shown = capsys.readouterr()
    assert "`run` needs --frame-rate" in shown.out
    assert "has no names of classes, which are numbers now" in shown.err
    assert out.read_text().splitlines()[1] == "8,left_8.png,9.5,19.5,29.5,39.5,1,0,0"
    assert call(folder, model, out, "--frame-rate", "4", "--classes", "coco") == 0
    table = read_detections(out)
    assert table.timestamp.tolist() == [2.0, 2.0, 2.25, 2.25, 2.5, 2.5]
    assert table.class_name[:2] == ("person", "car")
    times = tmp_path / "rgb.txt"
    times.write_text("3.5 rgb/left_9.png\n4.0 rgb/left_10.png\n")
    assert call(folder, model, out, "--frame-times", str(times)) == 0
    table = read_detections(out)
    assert table.timestamp.tolist() == [3.5, 3.5, 4.0, 4.0]
    assert table.box[:, 0].tolist() == [10.5, 49.5, 11.5, 49.5]


def test_a_film(tmp_path):
    """Its times are those of the file, from 0; a lossless codec keeps the pixels."""
    film = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter_fourcc(*"FFV1"), 8.0, (100, 60))
    for number in range(6):
        writer.write(paint(boxes_of(number), **SIZE))
    writer.release()
    model = save_colors(tmp_path / "model.onnx", **SIZE, names=CLASSES)
    assert call(film, model, tmp_path / "boxes.csv", "--every", "2") == 0
    table = read_detections(tmp_path / "boxes.csv")
    np.testing.assert_allclose(table.timestamp, np.repeat([0.0, 0.25, 0.5], 2), atol=1e-9)
    assert table.frame.tolist() == [0, 0, 2, 2, 4, 4]
    assert table.box[::2, 0].tolist() == [9.5, 11.5, 13.5]


def test_from_images_to_a_map(tmp_path, orbit):
    """Two commands: painted objects of an orbit are in the map where they are."""
    camera, odometry, _ = write_orbit(tmp_path, orbit)
    folder = tmp_path / "images"
    folder.mkdir()
    shown = list(NAMES)[:3]
    size = {name: CAMERA[name] for name in ("width", "height")}
    for pose, moment in enumerate(orbit.times.tolist()):
        # The painted pixels are those whose centers are in the box, or half a pixel beside it.
        boxes = [np.rint(orbit.boxes[pose, name] + 0.5).astype(int) for name in shown]
        write_image(folder / f"{moment:.6f}.png", paint(boxes, **size))
    model = save_colors(tmp_path / "model.onnx", **size, names=[NAMES[name] for name in shown])
    boxes, out = tmp_path / "found.csv", tmp_path / "out"
    assert call(folder, model, boxes, "-q") == 0
    files = ("--camera", camera, "--odometry", odometry, "--detections", boxes, "--out", out)
    assert main(["run", *map(str, files), "--ids", "class_id", "-q"]) == 0
    objects = json.loads((out / "map.json").read_text())["objects"]
    assert sorted(one["class_name"] for one in objects) == sorted(NAMES[name] for name in shown)
    for one in objects:
        (name,) = (number for number in shown if NAMES[number] == one["class_name"])
        # Noise of 1 px at 1.2 m is 2.4 mm; forty views average it.
        np.testing.assert_allclose(one["center"], orbit.centers[name], atol=0.003)


def test_mistakes(made, tmp_path, capsys):
    folder, model = made
    out = tmp_path / "boxes.csv"

    def refused(message, *arguments):
        assert call(*arguments) == 2
        assert_one_line_of_error(capsys, message)
        assert not out.exists()

    refused("none: no such folder of images, or film", tmp_path / "none", model, out)
    refused("is an input, which would be written over", folder, model, folder / "10.50.png")
    refused("is an input, which would be written over", folder, model, model)
    refused("class_nms is 1.5, not above 0", folder, model, out, "--class-nms", "1.5")
    refused("--model-size: '640' is not like", folder, model, out, "--model-size", "640")
    refused("model.onnx: is no film that OpenCV can read", model, model, out)
    names = tmp_path / "names.txt"
    names.write_text("cup\n")
    message = "model.onnx: has found an object of class 2, and 1 classes have names, 0 to 0"
    refused(message, folder, model, out, "--classes", str(names))
    nothing = save_constant(tmp_path / "none.onnx", {"o": np.zeros((1, 300, 6), dtype=np.float32)})
    refused("the detector has found nothing in 3 images", folder, nothing, out)
    write_image(folder / "12.00.png", np.zeros((61, 100, 3), dtype=np.uint8))
    refused("12.00.png: has 100 x 61 px, the images before it 100 x 60", folder, model, out)
    (folder / "12.00.png").write_bytes(b"\x89PNG nothing")
    refused("12.00.png: is no image that OpenCV can read", folder, model, out)


@pytest.mark.skipif(not hasattr(signal, "SIGINT"), reason="no signals")
def test_ctrl_c_leaves_nothing(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    image = paint(boxes_of(0), **SIZE)
    for number in range(3000):
        write_image(folder / f"{number:04}.png", image)
    model = save_colors(tmp_path / "model.onnx", width=1280, height=1280, names=CLASSES)
    out = tmp_path / "boxes.csv"
    code = "import sys; from dqslam.cli import main; print('here', flush=True); sys.exit(main())"
    arguments = ("--images", folder, "--model", model, "--out", out, "--threads", "1")
    command = [sys.executable, "-c", code, "detect", *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"here\n"
        # A library that is being imported may swallow a signal, as a person would notice.
        for _ in range(30):
            time.sleep(2.0)
            process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=4.0)
                break
        else:
            process.kill()
        said = process.stderr.read()
    assert process.returncode == 130
    assert said.decode().strip() == "dqslam: stopped"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["images", "model.onnx"]
