"""The doctor: what is wrong with frames, said before any image is made of them. One file a
check."""

from eitskin.frames.doctor.examine import examine
from eitskin.frames.doctor.report import DoctorReport, Finding
from eitskin.frames.doctor.subject import Subject, subject_from_frames, subject_from_source

__all__ = [
    "DoctorReport",
    "Finding",
    "Subject",
    "examine",
    "subject_from_frames",
    "subject_from_source",
]
