"""A stand-in for the pose network, which sees bright rectangles of a picture as people."""

import cv2
import numpy as np

from silhouette_core.image.pose_network import POINTS, Crop, PersonSeen, cropped


class BrightPeople:
    """Sees what is above 100 in a channel as a person, upright; at 150 as somebody doubtful."""

    def __init__(self, channel=0):
        self.looks, self.channel = 0, channel

    def look(self, picture, crop: Crop, others=None) -> PersonSeen:
        self.looks += 1
        square = cropped(picture, crop)[..., self.channel]
        if others is not None:
            square[others] = 0
        mask = square > 100
        count, labels, boxes, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
        if count > 1:  # the person in the middle of the square
            inner = int(np.linalg.norm(centres[1:] - 128, axis=1).argmin()) + 1
            mask = labels == inner
            large = boxes[inner, cv2.CC_STAT_AREA] > 300
        presence = 0.0 if count < 2 or not large else 0.85 if square[mask].mean() < 200 else 1.0
        middle = np.array(centres[inner] if count > 1 else (128, 128))
        back = crop.from_network
        places = np.tile(back[:, :2] @ middle + back[:, 2], (POINTS, 1))
        return PersonSeen(
            crop,
            presence,
            np.where(mask, 80, -80).astype(np.int8),
            places,
            np.ones(POINTS),
            np.array([places[0], places[0] - [0, 1]]),
        )


def picture(*people, size=(320, 240), value=255):
    """A dark picture (h, w, 3) with people, boxes (left, top, width, height)."""
    image = np.zeros((*size[::-1], 3), np.uint8)
    for left, top, width, height in people:
        image[top : top + height, left : left + width] = value
    return image
