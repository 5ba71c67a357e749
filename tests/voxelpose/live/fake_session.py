"""Controls that note what was asked of them."""

from dataclasses import replace

from voxelpose.live.live_frame import SessionState


class FakeControls:
    """A session that only changes its state.

    Attributes:
        asked: names of the calls, in order.
        state: the session's state.
    """

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.state = SessionState(
            "no background",
            "Leave the view and press Background.",
            frames=1204,
            dropped=17,
            fps=24.6,
            latency_s=0.043,
            stage_s={"silhouettes": 0.0061, "hull": 0.0038, "pose": 0.0112},
            cameras={"cam_1": "ok", "cam_2": "ok", "cam_3": "no picture for 2 s: check its cable"},
        )

    def learn_background(self) -> None:
        self.asked.append("learn_background")
        self.state = replace(self.state, phase="learning", message="Learning the empty room.")

    def start(self) -> None:
        self.asked.append("start")
        self.state = replace(self.state, phase="following", message="Following one person.")

    def stop(self) -> None:
        self.asked.append("stop")
        self.state = replace(self.state, phase="stopped", message="The cameras go on.")

    def record(self) -> None:
        self.asked.append("record")
        self.state = replace(self.state, recording=True)

    def end_recording(self) -> None:
        self.asked.append("end_recording")
        self.state = replace(self.state, recording=False)
