"""Recordings that tasks make: melodies that are recognised, and films that can be shown."""

import io

import numpy as np
import pytest
from PIL import Image

from hijack_data.rng import Stream
from online_env.tasks.folder_desktop import FolderDesktop
from online_env.tasks.kit import gimp, recordings
from online_env.tasks.machine import Machine

TUNE = recordings.melody(Stream(1, "test"))


@pytest.fixture
def machine(tmp_path):
    return Machine(FolderDesktop(tmp_path))


def listen(machine, data):
    machine.write("a.wav", data)
    result = recordings.sound(machine, "a.wav")
    assert result is not None
    return result


@pytest.mark.parametrize("form", [(1, 8000), recordings.CD])
def test_a_melody_is_recognised_at_any_rate(machine, form):
    result = listen(machine, recordings.wav_file(TUNE, *form))
    assert (result.channels, result.rate) == form
    assert list(recordings.melody_problems(result, TUNE)) == []


def test_another_melody_and_a_shorter_one_are_not(machine):
    whole_sound = listen(machine, recordings.wav_file(TUNE))
    second = [*TUNE[:-1], TUNE[-1] * 2 ** (2 / 12)]
    (problem,) = recordings.melody_problems(whole_sound, second)
    assert problem.startswith("note 8 has ")
    short = listen(machine, recordings.wav_file(TUNE[:4]))
    assert list(recordings.melody_problems(short, TUNE)) == ["it is 8.0 s long, not 16 s"]


def test_a_file_that_ends_within_a_sample_is_heard_so_far(machine):
    result = listen(machine, recordings.wav_file(TUNE)[:-1])
    assert len(result.samples) == len(TUNE) * recordings.NOTE * result.rate - 1


@pytest.mark.parametrize("data", [b"", b"RIFF", b"no sound at all"])
def test_what_is_no_sound_is_none(machine, data):
    machine.write("a.wav", data)
    assert recordings.sound(machine, "a.wav") is None
    assert recordings.sound(machine, "b.wav") is None


def test_a_film_shows_each_scene_for_its_time(tmp_path):
    cv2 = pytest.importorskip("cv2")
    scenes = [recordings.scene(Stream(seed, "test"), f"Scene {seed}") for seed in range(3)]
    path = tmp_path / "a.avi"
    path.write_bytes(recordings.film(scenes))
    film = cv2.VideoCapture(str(path))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 3 * recordings.SCENE * 5
    for index, scene in enumerate(scenes):
        film.set(cv2.CAP_PROP_POS_MSEC, 1000 * (index + 0.5) * recordings.SCENE)
        result = Image.fromarray(film.read()[1][:, :, ::-1])
        assert gimp.difference(result, scene) < 3
    film.release()


def test_the_index_of_a_film_points_to_its_pictures():
    scene = recordings.scene(Stream(0, "test"), "Only one")
    data = recordings.film([scene])
    assert int.from_bytes(data[4:8], "little") == len(data) - 8
    moving, index = data.index(b"movi"), data.rindex(b"idx1") + 8
    entries = np.frombuffer(data[index:], "<u4").reshape(-1, 4)
    assert len(entries) == recordings.SCENE * 5
    for _, _, place, length in (entries[0], entries[-1]):
        start = moving + int(place) + 8
        picture = Image.open(io.BytesIO(data[start : start + int(length)]))
        assert gimp.difference(picture, scene) < 3
