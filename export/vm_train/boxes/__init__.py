"""Boxes around objects in pictures of the user's own: YOLO, Pascal VOC and COCO, without lens and pose."""
