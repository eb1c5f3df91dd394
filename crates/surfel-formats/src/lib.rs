//! Files: point clouds in and out, pictures out.
