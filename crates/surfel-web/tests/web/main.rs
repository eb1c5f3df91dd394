//! The server in the view of pages, of programs and of misbehaving clients.

mod abuse;
mod access;
mod added_files;
mod frame_delivery;
mod hill_provider;
mod http_client;
mod http_routes;
mod load;
#[path = "../../examples/load/clients.rs"]
mod load_clients;
mod page_files;
mod protocol;
mod scene_updates;
mod test_page;
mod test_server;
mod tls;
