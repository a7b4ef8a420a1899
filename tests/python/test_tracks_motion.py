"""The motion that classes have."""

from dqslam.tracks.motion import ANYTHING, CYCLE, PERSON, VEHICLE, motion_noise


def test_classes_have_their_motion_by_any_case():
    assert motion_noise("Car") is VEHICLE and motion_noise("Pedestrian") is PERSON
    assert motion_noise("bicycle") is CYCLE and motion_noise("kite") is ANYTHING


def test_a_person_turns_faster_and_is_slower_than_a_car():
    assert PERSON.turn > VEHICLE.turn and PERSON.usual_speed < VEHICLE.usual_speed
    assert (VEHICLE.acceleration, VEHICLE.slip, VEHICLE.usual_turn) == (1.0, 0.05, 0.2)
