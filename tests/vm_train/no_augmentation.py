"""The configuration of augmentation that changes nothing."""

from vm_train.graphs.augmentation import Augmentation

NO_AUGMENTATION = Augmentation(
    height=0.0,
    tilt=0.0,
    focal_length=0.0,
    center=0.0,
    brightness=0.0,
    contrast=0.0,
    saturation=0.0,
    hue=0.0,
    gamma=0.0,
    noise=0.0,
    blur_share=0.0,
    jpeg_share=0.0,
)
