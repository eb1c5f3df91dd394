//! The table of open connections: those without an authorised request have few places, and lose them first.

use crate::limits::Limits;
use crate::lock::lock;
use std::collections::{HashMap, HashSet, VecDeque};
use std::net::{IpAddr, Ipv6Addr};
use std::sync::{Arc, Mutex, MutexGuard};
use tokio::sync::Notify;

/// The open connections of a server.
///
/// A connection is *pending* until a request on it is authorised. Pending connections cannot take the places of the
/// others. If there are too many, the address with the most of them loses its oldest one, so a connection that is new
/// always finds a place, and an address that holds many of them disturbs only itself.
pub struct ConnectionTable {
    max_authorized: usize,
    max_pending: usize,
    state: Mutex<TableState>,
}

#[derive(Default)]
struct TableState {
    n_opened: u64,
    authorized: HashSet<u64>,
    /// The oldest one is the first.
    pending: VecDeque<PendingConnection>,
}

struct PendingConnection {
    id: u64,
    source: IpAddr,
    eviction: Arc<Notify>,
}

/// An entry of the table, which is removed when it is dropped.
pub struct ConnectionEntry {
    id: u64,
    eviction: Arc<Notify>,
    table: Arc<ConnectionTable>,
}

impl ConnectionTable {
    /// A table without connections.
    pub fn new(limits: &Limits) -> Self {
        Self {
            max_authorized: limits.max_connections,
            max_pending: limits.max_pending_connections,
            state: Mutex::default(),
        }
    }

    /// Adds a pending connection from this address, and evicts another one if there are too many.
    pub fn add(self: &Arc<Self>, address: IpAddr) -> ConnectionEntry {
        let mut state = self.lock();
        if self.max_pending <= state.pending.len() {
            state.evict();
        }
        state.n_opened += 1;
        let (id, source, eviction) = (state.n_opened, source_of(address), Arc::<Notify>::default());
        state.pending.push_back(PendingConnection { id, source, eviction: eviction.clone() });
        ConnectionEntry { id, eviction, table: self.clone() }
    }

    fn lock(&self) -> MutexGuard<'_, TableState> {
        lock(&self.state)
    }
}

impl TableState {
    fn evict(&mut self) {
        let mut counts: HashMap<IpAddr, usize> = HashMap::new();
        for pending in &self.pending {
            *counts.entry(pending.source).or_default() += 1;
        }
        let most = counts.values().max().copied();
        let oldest =
            self.pending.iter().position(|pending| counts.get(&pending.source).copied() == most);
        if let Some(evicted) = oldest.and_then(|i| self.pending.remove(i)) {
            evicted.eviction.notify_one();
        }
    }
}

impl ConnectionEntry {
    /// Records that a request on this connection is authorised. Returns false if there are too many such
    /// connections, or if this one has just been evicted.
    pub fn authorize(&self) -> bool {
        let mut state = self.table.lock();
        if state.authorized.contains(&self.id) {
            return true;
        }
        if self.table.max_authorized <= state.authorized.len() {
            return false;
        }
        let index = state.pending.iter().position(|pending| pending.id == self.id);
        let Some(index) = index else { return false };
        state.pending.remove(index);
        state.authorized.insert(self.id)
    }

    /// Waits until the connection has lost its place to another one.
    pub async fn evicted(&self) {
        self.eviction.notified().await;
    }
}

impl Drop for ConnectionEntry {
    fn drop(&mut self) {
        let mut state = self.table.lock();
        state.authorized.remove(&self.id);
        state.pending.retain(|pending| pending.id != self.id);
    }
}

/// The address that counts as one sender. A single machine usually has all 2^64 addresses of a prefix of IPv6.
fn source_of(address: IpAddr) -> IpAddr {
    const PREFIX: u128 = u128::MAX << 64;
    match address.to_canonical() {
        IpAddr::V6(address) => Ipv6Addr::from_bits(address.to_bits() & PREFIX).into(),
        address => address,
    }
}

#[cfg(test)]
mod tests {
    //! Eviction of pending connections, and the places of authorised ones.

    use super::*;
    use futures_util::FutureExt;

    fn table(max_connections: usize, max_pending_connections: usize) -> Arc<ConnectionTable> {
        let limits = Limits { max_connections, max_pending_connections, ..Limits::default() };
        Arc::new(ConnectionTable::new(&limits))
    }

    fn is_evicted(entry: &ConnectionEntry) -> bool {
        entry.evicted().now_or_never().is_some()
    }

    #[test]
    fn the_oldest_pending_connection_is_evicted() {
        let table = table(1, 2);
        let entries: Vec<_> = (0..4).map(|_| table.add([192, 0, 2, 1].into())).collect();
        let evicted: Vec<bool> = entries.iter().map(is_evicted).collect();
        assert_eq!(evicted, [true, true, false, false]);
        assert!(!entries[0].authorize());
        assert!(entries[3].authorize() && entries[3].authorize());
    }

    #[test]
    fn an_address_with_many_connections_evicts_its_own() {
        for sources in [
            [IpAddr::from([192, 0, 2, 1]), [192, 0, 2, 2].into()],
            ["2001:db8::1".parse().unwrap(), "2001:db8:0:1::1".parse().unwrap()],
        ] {
            let table = table(1, 3);
            let single = table.add(sources[0]);
            let many: Vec<_> = (0..50).map(|_| table.add(sources[1])).collect();
            assert!(!is_evicted(&single));
            assert_eq!(many.iter().filter(|entry| is_evicted(entry)).count(), 48);
            assert!(single.authorize());
        }
    }

    #[test]
    fn addresses_of_one_prefix_count_as_one() {
        let table = table(1, 3);
        let other = table.add([192, 0, 2, 1].into());
        let many = (1..9).map(|i| table.add(Ipv6Addr::new(0x2001, 0xdb8, 0, 0, i, 0, 0, i).into()));
        let many: Vec<_> = many.collect();
        assert!(!is_evicted(&other) && is_evicted(&many[0]));
    }

    #[test]
    fn authorized_connections_have_places_of_their_own() {
        let table = table(2, 2);
        let authorized: Vec<_> = (0..2).map(|_| table.add([192, 0, 2, 1].into())).collect();
        assert!(authorized.iter().all(ConnectionEntry::authorize));
        let pending: Vec<_> = (0..9).map(|_| table.add([192, 0, 2, 1].into())).collect();
        assert!(!authorized.iter().any(is_evicted));
        assert!(!pending[8].authorize());
        drop(authorized);
        assert!(pending[8].authorize());
    }
}
