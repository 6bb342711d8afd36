//! Soft tissue: tetrahedra, materials, attachments and rigid tools to model, state and step.
