"""The page of one recording folder: what it is answered, and its server behind the gate."""

from collections.abc import Mapping, Sequence

from voxelpose.setup_page.page_requests import (
    LARGEST_BODY,
    GroundRequest,
    PointsRequest,
    SaveRequest,
    SilhouetteRequest,
    StageRequest,
)
from voxelpose.setup_page.setup_session import SetupSession
from voxelpose.view.serving.gate import Address, Gate, GatedServer
from voxelpose.view.serving.page_answers import (
    Content,
    PageAnswers,
    json_content,
    parse_request,
    whole_number,
)


class SetupPage:
    """A session's page; its `answers` are to requests of it."""

    def __init__(self, session: SetupSession) -> None:
        self.session = session
        self.answers = PageAnswers("voxelpose.setup_page", self._get, self._post)

    def _get(self, path: Sequence[str], query: Mapping[str, str]) -> Content | None:
        session = self.session
        match path:
            case ("api", "state"):
                return json_content(session.state())
            case ("api", "check"):
                return json_content(session.check_status())
            case ("picture", camera):
                return session.picture(camera, whole_number(query, "moment")), "image/jpeg"
            case ("painted", kind, camera):
                return session.painted(camera, kind), "image/png"
        return None

    def _post(self, path: Sequence[str], body: bytes) -> Content | None:
        session = self.session
        match path:
            case ("api", "silhouettes"):
                return json_content(session.silhouettes(parse_request(body, SilhouetteRequest)))
            case ("api", "stage"):
                return json_content(session.stage(parse_request(body, StageRequest)))
            case ("api", "points"):
                return json_content(session.errors(parse_request(body, PointsRequest)))
            case ("api", "ground"):
                return json_content(session.ground(parse_request(body, GroundRequest)))
            case ("api", "save"):
                return json_content(session.save(parse_request(body, SaveRequest)))
            case ("api", "check", "start"):
                return json_content(session.start_check())
            case ("api", "check", "repair"):
                return json_content(session.repair())
            case ("api", "check", "stop"):
                return json_content(session.stop_check())
        return None


class SetupServer(GatedServer):
    """Serves the page until it is closed."""

    def __init__(self, session: SetupSession, address: Address) -> None:
        """Starts, in a thread of its own; the session is closed with it. InputError where the
        address cannot be used.
        """
        gate = Gate(address, SetupPage(session).answers.serve, LARGEST_BODY)
        super().__init__(gate, session.close)
