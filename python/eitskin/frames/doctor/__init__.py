"""The doctor: it finds out what is wrong with frames before any image is made of them. Each check
has its own file."""

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
