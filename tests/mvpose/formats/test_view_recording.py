"""Detections of whole recordings: every layout gives the same people, and what does not fit is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from lab_files import (
    filmed,
    write_coco,
    write_mmpose,
    write_openpose,
    write_pose2sim,
    write_rtmlib,
    write_rtmlib_arrays,
)

from mvpose.formats.detections.recorded_frames import read_frames, read_recording
from mvpose.formats.detections.sources import Source, assign, find_sources

NAMES = ["cam0", "cam1", "cam2", "cam3"]


def write_alphapose(folder, names, pixels):
    write_coco(
        folder, [f"alphapose-results_{name}" for name in names], pixels, image_id=lambda k: f"{k}.jpg", box="box"
    )


def write_demo_of_mmpose(folder, names, pixels):
    write_mmpose(folder / "predictions", names, pixels, meta=True)


LAYOUTS = [
    write_openpose, write_coco, write_alphapose, write_mmpose, write_demo_of_mmpose, write_rtmlib, write_rtmlib_arrays,
    write_pose2sim,
]  # fmt: skip


def times(recorded):
    return np.repeat(recorded.numbers[:, None] / 25.0, len(recorded.pictures), axis=1)


class TestLayouts:
    @pytest.mark.parametrize("write", LAYOUTS)
    def test_every_layout_gives_the_keypoints_that_were_written(self, tmp_path, write):
        _, _, pixels = filmed(frames=11)  # two digits: 10 comes after 9
        write(tmp_path / "lab", NAMES, pixels)
        recorded = read_recording(NAMES, [tmp_path / "lab"])
        assert recorded.assignment.by_name
        assert recorded.numbers.tolist() == list(range(11))
        for frame, detections in enumerate(recorded.detections(times(recorded))):
            assert detections.view.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
            np.testing.assert_allclose(detections.keypoints.reshape(4, 2, 17, 2), pixels[frame], atol=1e-9)
            np.testing.assert_allclose(detections.scores, 0.9)
            assert (detections.box_scores <= 1).all()
            np.testing.assert_allclose(detections.time, frame / 25.0)

    @pytest.mark.parametrize("write", LAYOUTS)
    def test_some_frames_of_every_layout(self, tmp_path, write):
        _, _, pixels = filmed(frames=11)
        write(tmp_path / "lab", NAMES, pixels)
        wanted = np.array([2, 3, 10])
        for frame, detections in zip(wanted, read_frames(NAMES[1:], tmp_path / "lab", wanted), strict=True):
            assert detections.view.tolist() == [0, 0, 1, 1, 2, 2]
            np.testing.assert_allclose(detections.keypoints.reshape(3, 2, 17, 2), pixels[frame][1:], atol=1e-9)
            assert detections.time is None

    def test_boxes_of_all_layouts_span_the_keypoints(self, tmp_path):
        _, _, pixels = filmed(frames=2)
        boxes = []
        for write in (write_openpose, write_alphapose, write_mmpose):
            write(tmp_path / write.__name__, NAMES, pixels)
            recorded = read_recording(NAMES, [tmp_path / write.__name__])
            boxes.append(recorded.detections(times(recorded))[1].boxes)
        np.testing.assert_allclose(boxes[1], boxes[0], atol=1e-9)
        np.testing.assert_allclose(boxes[2], boxes[0], atol=1e-9)

    def test_scores_slightly_above_one_are_clipped_and_others_refused(self, tmp_path):
        _, _, pixels = filmed(frames=2)
        write_openpose(tmp_path / "over", NAMES, pixels, score=1.00073)
        recorded = read_recording(NAMES, [tmp_path / "over"])
        assert recorded.detections(times(recorded))[0].scores.max() == 1.0
        write_openpose(tmp_path / "percent", NAMES, pixels, score=87.0)
        with pytest.raises(ValueError, match=r"scores must lie in 0\.\.1, got 87; divide per cent by 100"):
            read_recording(NAMES, [tmp_path / "percent"])

    def test_a_skeleton_of_unknown_size_is_refused_and_a_declared_one_checked(self, tmp_path):
        frames = [{"keypoints": [[[1.0, 2.0]] * 11], "scores": [[0.5] * 11]}]
        for name in NAMES:
            (tmp_path / f"{name}.json").write_text(json.dumps(frames))
        with pytest.raises(ValueError, match=r"have 11 joints a person; expected .*coco17 \(17\)"):
            read_recording(NAMES, [tmp_path])

    def test_a_lost_picture_has_no_time_and_nobody(self, tmp_path):
        _, _, pixels = filmed(frames=6)
        write_openpose(tmp_path, NAMES, pixels)
        next((tmp_path / "cam1").glob("*3_keypoints.json")).unlink()
        recorded = read_recording(NAMES, [tmp_path])
        lost = recorded.detections(times(recorded))[3]
        assert np.isnan(lost.time).tolist() == [False, True, False, False]
        assert 1 not in lost.view

    def test_frames_without_entries_in_a_list_of_results_have_nobody(self, tmp_path):
        _, _, pixels = filmed(frames=6)
        write_coco(tmp_path, NAMES, pixels)
        file = tmp_path / "cam2.json"
        file.write_text(json.dumps([each for each in json.loads(file.read_text()) if each["image_id"] not in (2, 5)]))
        recorded = read_recording(NAMES, [tmp_path])
        gone = recorded.detections(times(recorded))
        assert len(recorded) == 6
        assert all(2 not in gone[k].view and np.isfinite(gone[k].time).all() for k in (2, 5))


class TestRefusals:
    @pytest.fixture
    def lab(self, tmp_path):
        _, _, pixels = filmed(frames=4)
        write_openpose(tmp_path / "lab", NAMES, pixels)
        return tmp_path / "lab"

    def refused(self, match, *paths, **options):
        with pytest.raises(ValueError, match=match) as error:
            read_recording(NAMES, [Path(path) for path in paths], **options)
        assert "\n" not in str(error.value)

    def test_an_empty_folder(self, tmp_path):
        (tmp_path / "empty").mkdir()
        self.refused(r"empty: is an empty folder; expected \*\.json or \*\.npz, or a folder", tmp_path / "empty")

    def test_a_missing_folder_and_a_video(self, tmp_path):
        self.refused("nowhere: no such file or folder", tmp_path / "nowhere")
        (tmp_path / "cam0.mp4").write_bytes(b"")
        self.refused("expected detections.*mvpose detect", tmp_path / "cam0.mp4")

    def test_a_camera_without_files(self, lab):
        (lab / "cam2").rename(lab / "elsewhere")
        self.refused("no detections for the camera cam2: .*--cameras cam0,cam1,cam3", lab)

    def test_a_camera_without_anybody(self, lab):
        for file in (lab / "cam1").iterdir():
            file.write_text('{"people": []}')
        self.refused("nobody is detected in any frame of the camera cam1.*--cameras cam0,cam2,cam3", lab)

    def test_different_lengths_with_the_frames_that_all_have(self, lab):
        next((lab / "cam3").glob("*3_keypoints.json")).unlink()
        self.refused(r"different frames: cam0 0 to 3.*cam3 0 to 2; give .*--frames 0:2", lab)
        assert len(read_recording(NAMES, [lab], frames=(0, 2))) == 3
        self.refused(r"--frames 9:12: no camera has such a frame; the files have 0 to 3", lab, frames=(9, 12))

    def test_one_source_twice(self, lab):
        self.refused("cam0: is given twice", lab / "cam0", lab / "cam0", lab / "cam2", lab / "cam3")

    def test_two_files_of_one_camera(self, lab, tmp_path):
        (tmp_path / "more" / "cam-0").mkdir(parents=True)
        (tmp_path / "more" / "cam-0" / "0.json").write_text('{"people": []}')
        self.refused("camera 'cam0' has 2 sources of detections", lab, tmp_path / "more" / "cam-0")

    def test_another_number_of_cameras(self, lab):
        for k, letter in enumerate("abc"):
            (lab / f"cam{k}").rename(lab.parent / letter)
        self.refused(
            "4 cameras, cam0, cam1, cam2, cam3, but there are detections of 3, a, b, c",
            *(lab.parent / letter for letter in "abc"),
        )

    @pytest.mark.parametrize(
        ("content", "match"),
        [
            ('{"skeleton": [1]}', "expected the people of one picture.*an object with the keys skeleton"),
            ('{"people": ', "broken or truncated JSON"),
            ('{"people": [{"pose_keypoints_2d": ["a"]}]}', "has 0 joints a person|other than numbers"),
            ("[1, 2]", "expected the people of one picture.*a list that begins with 1"),
        ],
    )
    def test_unknown_and_broken_json(self, lab, content, match):
        sorted((lab / "cam0").iterdir())[2].write_text(content)
        self.refused(match, lab)

    def test_annotations_in_place_of_results(self, tmp_path):
        for name in NAMES:
            (tmp_path / f"{name}.json").write_text('{"images": [], "annotations": []}')
        self.refused("COCO annotations|no such|expected", *(tmp_path / f"{name}.json" for name in NAMES))


class TestAssignment:
    @pytest.mark.parametrize(
        ("cameras", "sources", "order"),
        [
            (["cam1", "cam2"], ["cam2", "cam1"], [1, 0]),
            (["Cam_1", "Cam_2"], ["cam1", "cam2"], [0, 1]),
            (["int_cam1_img", "int_cam2_img"], ["cam2", "cam1"], [1, 0]),
            (["camera 01", "camera 02"], ["view2", "view1"], [1, 0]),
            (["cam1", "cam2"], ["cam1", "cam2", "cam10"], [0, 1]),
            (["1", "11"], ["11", "1"], [1, 0]),
        ],
    )
    def test_by_name(self, cameras, sources, order):
        found = assign(cameras, [Source(name, Path(name)) for name in sources])
        assert found.by_name
        assert [sources.index(each.name) for each in found.sources] == order
        assert len(found.unused) == len(sources) - len(cameras)

    def test_in_order_where_no_name_fits_and_the_message_says_so(self):
        found = assign(["left", "right"], [Source("a", Path("a")), Source("b", Path("b"))])
        assert not found.by_name
        text = found.text(["left", "right"])
        assert text.startswith("detections of cameras, in order, because their names differ")
        assert text.endswith(": left = a, right = b")

    def test_folders_are_in_the_order_of_their_numbers(self, tmp_path):
        for k in (10, 9, 1):
            (tmp_path / f"view{k}").mkdir()
            (tmp_path / f"view{k}" / "0.json").write_text('{"people": []}')
        assert [each.name for each in find_sources([tmp_path])] == ["view1", "view9", "view10"]
