"""Writes annotated images in each of the formats, in layouts that annotation tools make, and reads them."""

import json
import zlib
from xml.etree import ElementTree

import cv2
import numpy as np
from PIL import Image

from vm_train.boxes.read import read_boxes

SIZE = (160, 120)


def write_image(path, seed=None, size=SIZE, orientation=None):
    """An image of its own content, with an EXIF orientation if one is given. size: as stored."""
    path.parent.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(zlib.crc32("/".join(path.parts[-3:]).encode()) if seed is None else seed)
    coarse = random.integers(0, 255, (3, 4, 3), dtype=np.uint8)
    image = cv2.resize(coarse, size, interpolation=cv2.INTER_CUBIC)
    exif = Image.Exif()
    if orientation is not None:
        exif[0x0112] = orientation
    Image.fromarray(image).save(path, exif=exif)


def write_yolo(folder, pictures, beside=True, size=SIZE):
    """pictures: by name, lists of (class name, left, top, right, bottom) with edges from 0 [px]."""
    names = sorted({box[0] for boxes in pictures.values() for box in boxes})
    texts = folder if beside else folder / "labels"
    texts.mkdir(parents=True, exist_ok=True)
    (folder / "classes.txt").write_text("".join(f"{name}\n" for name in names))
    for name, boxes in pictures.items():
        write_image((folder if beside else folder / "images") / f"{name}.jpg", size=size)
        lines = [
            f"{names.index(kind)} {(x0 + x1) / 2 / size[0]!r} {(y0 + y1) / 2 / size[1]!r} "
            f"{(x1 - x0) / size[0]!r} {(y1 - y0) / size[1]!r}\n"
            for kind, x0, y0, x1, y1 in boxes
        ]
        (texts / f"{name}.txt").write_text("".join(lines))


def voc_text(name, boxes, size=SIZE):
    root = ElementTree.Element("annotation")
    ElementTree.SubElement(root, "filename").text = name
    if size is not None:
        element = ElementTree.SubElement(root, "size")
        for entry, value in zip(("width", "height", "depth"), (*size, 3), strict=True):
            ElementTree.SubElement(element, entry).text = str(value)
    for kind, *edges in boxes:
        element = ElementTree.SubElement(root, "object")
        ElementTree.SubElement(element, "name").text = kind
        place = ElementTree.SubElement(element, "bndbox")
        for entry, value in zip(("xmin", "ymin", "xmax", "ymax"), edges, strict=True):
            ElementTree.SubElement(place, entry).text = repr(value)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def write_voc(folder, pictures, beside=True, size=SIZE):
    texts = folder if beside else folder / "Annotations"
    texts.mkdir(parents=True, exist_ok=True)
    for name, boxes in pictures.items():
        write_image((folder if beside else folder / "JPEGImages") / f"{name}.jpg", size=size)
        (texts / f"{name}.xml").write_text(voc_text(f"{name}.jpg", boxes, size))


def coco_table(pictures, size=SIZE):
    names = sorted({box[0] for boxes in pictures.values() for box in boxes})
    images = [
        {"id": 10 + number, "file_name": f"{name}.jpg", "width": size[0], "height": size[1]}
        for number, name in enumerate(pictures)
    ]
    annotations = [
        {"image_id": 10 + number, "category_id": 3 + names.index(kind), "bbox": [x0, y0, x1 - x0, y1 - y0]}
        for number, boxes in enumerate(pictures.values())
        for kind, x0, y0, x1, y1 in boxes
    ]
    return {
        "images": images,
        "annotations": [{"id": number, **each} for number, each in enumerate(annotations, start=1)],
        "categories": [{"id": 3 + number, "name": name} for number, name in enumerate(names)],
    }


def write_coco(folder, pictures, beside=True, size=SIZE):
    place = folder if beside else folder / "annotations"
    place.mkdir(parents=True, exist_ok=True)
    for name in pictures:
        write_image((folder if beside else folder / "images") / f"{name}.jpg", size=size)
    (place / "instances.json").write_text(json.dumps(coco_table(pictures, size)))


WRITERS = {"yolo": write_yolo, "voc": write_voc, "coco": write_coco}


def boxes_of(folder, **options):
    """Boxes of the usable pictures, by the stem of the image, and all faults and remarks."""
    found = read_boxes(folder, **options)
    return {each.image.stem: each.boxes for each in found.pictures}, [each.text for each in found.findings]
