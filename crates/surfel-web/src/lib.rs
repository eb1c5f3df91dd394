//! The interactive viewer: a server, and the page on which a scene is ray traced while the user moves in it.
//!
//! A [`Server`] renders, through a [`Renderer`](surfel_core::render::Renderer), the scenes that a
//! [`SceneProvider`] prepares from the settings that pages send. The program that starts the server implements
//! the provider. docs/server.md describes the messages between page and server, and the requests for programs.

mod lock;
mod scene_provider;
mod random_name;
mod merge_patch;
mod limits;
mod message;
mod frame_ancestors;
mod access;
mod bundle;
mod page;
mod deadline;
mod dynamic_resolution;
mod keyframe;
mod encode;
mod frame;
mod view;
mod visibility;
mod sample_counts;
mod slice_timing;
mod accumulator;
mod outgoing;
mod handshake;
mod client;
mod render_loop;
mod pick;
mod corners;
mod profile;
mod volume;
mod progress_reporter;
mod pending_changes;
mod downloads;
mod added_files;
mod server_state;
mod scene_update;
mod long_work;
mod add_file;
mod session;
mod connections;
mod tls;
mod routes;
mod server;

pub use frame_ancestors::FrameAncestors;
pub use limits::{Limits, Timeouts};
pub use scene_provider::{
    AddedFile, Error, Export, MovieRequest, PickedPoint, PictureOverlay, PicturePart,
    PointDescriber, PointLocator, PreparedScene, Result, SceneProvider, SentFile, SettingsMap,
    WrittenFile,
};
pub use server::Server;
pub use tls::{TlsError, TlsIdentity};
