//! Bytes of a head CT (DICOM, NIfTI, NRRD, MetaImage) to one volume in HU in the patient frame, or a named refusal.
