//! A ring: master -> drive N-1 -> ... -> drive 0 -> master, in virtual time (ND21 8.4, 8.5).
//!
//! A drive sees nothing but what the one before it sends. So there is no queue of events for the whole
//! ring: [`Ring::run_until`] walks it once, drive after drive, and each does everything that is due on
//! its inbound link up to that time. Drives in a row that only pass bytes on are advanced together, as a group; nothing but
//! the cost shows it.

use crate::fault::{DriveFault, LinkFault};
use crate::novobus::device::Device;
use crate::novobus::group::{Group, LEAST};
use crate::novobus::link::Link;
use crate::novobus::node::RingNode;
use crate::record::{Channel, LineByte, Remark, Trace};
use harness_proto::line::{Rate, Received};
use harness_proto::novobus::address::RingSize;
use harness_proto::time::{Instant, Span};
use std::collections::VecDeque;
use std::sync::OnceLock;

/// How many byte times one walk covers at most: what is under way then stays in the processor's cache.
const BYTES_A_WALK: u64 = 64;

/// A byte that was neither sent nor received.
const NO_BYTE: LineByte = LineByte {
    at: Instant::START,
    sent: None,
    received: None,
    error: None,
    solicited: false,
};

/// Byte times between attempts to form groups. An attempt looks at each drive once, which must not show beside advancing them.
const BYTES_AN_ATTEMPT: u64 = 256;

/// Drives of groups as of now, as far as they were looked at.
type Views<D> = OnceLock<Vec<OnceLock<Box<D>>>>;

/// A ring of drives of one kind.
#[derive(Clone, Debug)]
pub struct Ring<D> {
    size: RingSize,
    rate: Rate,
    /// `links[i]` ends at `nodes[i]`; the last one ends at the master.
    links: Vec<Link>,
    nodes: Vec<RingNode<D>>,
    /// What the master still has to send, with the time before which it must not.
    outbox: VecDeque<(Instant, u8)>,
    /// Bytes that the master has received and the caller has not fetched.
    inbox: VecDeque<LineByte>,
    now: Instant,
    /// When the master will have sent everything that it has to send.
    sent_by: Instant,
    /// Drives that are advanced together, in the order of the ring.
    groups: Vec<Group>,
    /// When to look for more of them; `None` where each drive is advanced by itself.
    next_groups: Option<Instant>,
    views: Views<D>,
}

impl<D: Device> Ring<D> {
    /// A ring on a line of the given rate; `device(k)` makes drive k.
    pub fn new(size: RingSize, rate: Rate, mut device: impl FnMut(u8) -> D) -> Self {
        let drives = (0..size.drives()).rev();
        Self {
            size,
            rate,
            links: vec![Link::new(rate.byte_time()); usize::from(size.drives()) + 1],
            nodes: drives.map(|k| RingNode::new(device(k), k)).collect(),
            outbox: VecDeque::new(),
            inbox: VecDeque::new(),
            now: Instant::START,
            sent_by: Instant::START,
            groups: Vec::new(),
            // A short ring has no room for a group.
            next_groups: (usize::from(size.drives()) >= LEAST).then_some(Instant::START),
            views: OnceLock::new(),
        }
    }

    /// Advances each drive by itself from now on: the reference for the tests of groups, and much slower on a long ring.
    pub fn advance_each(&mut self) {
        self.end_groups(|_| true);
        self.next_groups = None;
    }

    /// How many drives are advanced together with others at present.
    #[must_use]
    pub fn grouped(&self) -> usize {
        self.groups.iter().map(|group| group.places().len()).sum()
    }

    /// Ends the groups of which this is true.
    fn end_groups(&mut self, mut which: impl FnMut(&Group) -> bool) {
        self.keep_views();
        let (nodes, links, now) = (&mut self.nodes, &mut self.links, self.now);
        self.groups.retain(|group| {
            let ends = which(group);
            if ends {
                let places = group.places();
                group.end(&mut nodes[places.clone()], &mut links[places], now);
            }
            !ends
        });
    }

    /// Ends the group inside of which this link is.
    fn free_link(&mut self, link: usize) {
        self.end_groups(|group| group.places().skip(1).any(|place| place == link));
    }

    /// Ends the group of the drive in this place.
    fn free_place(&mut self, place: usize) {
        self.end_groups(|group| group.places().contains(&place));
    }

    /// Goes on with the drives as they were looked at: what they had to make up for is done once.
    fn keep_views(&mut self) {
        let views = self.views.take().unwrap_or_default();
        for (node, view) in self.nodes.iter_mut().zip(views) {
            if let Some(device) = view.into_inner() {
                *node.device_mut() = *device;
            }
        }
    }

    /// Forms groups of drives that are in none.
    #[cold]
    fn form_groups(&mut self) {
        let now = self.now;
        self.next_groups = Some(now + self.byte_time() * BYTES_AN_ATTEMPT);
        // From the end of the ring, where the oldest of the bytes under way are. The first `index` groups are ahead of `end`.
        let (mut end, mut index) = (self.nodes.len(), self.groups.len());
        loop {
            let ahead = index
                .checked_sub(1)
                .map(|ahead| self.groups[ahead].places());
            let start = ahead.as_ref().map_or(0, |ahead| ahead.end);
            let (nodes, links) = (&self.nodes[start..end], &mut self.links[start..=end]);
            if let Some(group) = Group::form(start, nodes, links, self.nodes.len(), now) {
                end = group.places().start;
                self.groups.insert(index, group);
            } else if end > start {
                end -= 1;
            } else if let Some(ahead) = ahead {
                (end, index) = (ahead.start, index - 1);
            } else {
                return;
            }
        }
    }

    /// Is as new again once `restart` has made each device so, but keeps room, and what is recorded and what is not: a run of many short
    /// cases does not ask for memory in each.
    pub fn restart(&mut self, mut restart: impl FnMut(&mut D)) {
        self.groups.clear();
        self.views = OnceLock::new();
        self.next_groups = self.next_groups.map(|_| Instant::START);
        self.links.iter_mut().for_each(Link::restart);
        for node in &mut self.nodes {
            restart(node.device_mut());
            node.restart();
        }
        self.outbox.clear();
        self.inbox.clear();
        self.now = Instant::START;
        self.sent_by = Instant::START;
    }

    /// Reserves room for this number of bytes on every link, so that a short run does not reallocate.
    pub fn reserve(&mut self, bytes: usize) {
        self.links.iter_mut().for_each(|link| link.reserve(bytes));
        self.outbox.reserve(bytes);
        self.inbox.reserve(bytes);
    }

    /// What link `link` has carried so far, as far as it was recorded; what was taken by [`Self::take_record`] is gone.
    /// `None` where the ring has no such link.
    #[must_use]
    pub fn carried_by(
        &self,
        link: usize,
    ) -> Option<impl ExactSizeIterator<Item = LineByte> + Clone + '_> {
        let carried = self.links.get(link)?;
        let inside = |group: &&Group| group.places().skip(1).any(|place| place == link);
        let group = self.groups.iter().find(inside);
        let first = carried.logged();
        let count = first + group.map_or(0, |group| group.logged(link, self.now));
        let byte = move |index: usize| match index.checked_sub(first) {
            None => carried.logged_byte(index),
            Some(index) => group?.logged_byte(link, index),
        };
        // Each index is that of a byte.
        Some((0..count).map(move |index| byte(index).unwrap_or(NO_BYTE)))
    }

    /// Keeps no record of bytes and marks from now on: for runs that are too long for one.
    pub fn stop_recording(&mut self) {
        self.end_groups(|_| true);
        self.links.iter_mut().for_each(Link::stop_recording);
        self.nodes.iter_mut().for_each(RingNode::stop_recording);
    }

    /// Forgets what was recorded, and records bytes and marks from now on.
    pub fn record_anew(&mut self) {
        self.end_groups(|_| true);
        self.links.iter_mut().for_each(Link::record_anew);
        self.nodes.iter_mut().for_each(RingNode::record_anew);
    }

    /// Records what link `link` carries from now on, for [`Self::take_record`]: a tap.
    pub fn record_link(&mut self, link: usize) {
        self.free_link(link);
        if let Some(link) = self.links.get_mut(link) {
            link.record_anew();
        }
    }

    /// What link `link` has carried since the last call, as far as it was recorded.
    pub fn take_record(&mut self, link: usize) -> Vec<LineByte> {
        self.free_link(link);
        self.links
            .get_mut(link)
            .map(Link::take_log)
            .unwrap_or_default()
    }

    /// Records what drives remark from now on, for [`Self::take_remarks`].
    pub fn record_remarks(&mut self) {
        self.nodes.iter_mut().for_each(RingNode::record_anew);
    }

    /// What drives have remarked since the last call, as far as it was recorded, in order of time.
    pub fn take_remarks(&mut self) -> Vec<Remark> {
        let mut remarks: Vec<_> = self
            .nodes
            .iter_mut()
            .flat_map(RingNode::take_remarks)
            .collect();
        remarks.sort_by_key(|remark| remark.at);
        remarks
    }

    /// How many of the bytes that were sent on link `link` since the conversation began have come to its end, or were lost on it: by this
    /// number a remark names its answer. It is right when recording has just begun.
    #[must_use]
    pub fn delivered(&self, link: usize) -> u64 {
        self.links.get(link).map_or(0, Link::delivered)
    }

    /// Cuts link `link` open: what its transmitter sends is to be fetched, and its receiver hears what is fed. Faults
    /// of the link act in front of the cut.
    pub fn open_link(&mut self, link: usize) {
        self.free_link(link);
        if let Some(link) = self.links.get_mut(link) {
            link.open();
        }
    }

    /// Feeds the receiver of an open link a byte, behind those fed before; says when it arrives.
    pub fn feed_link(&mut self, link: usize, byte: Received) -> Instant {
        self.free_link(link);
        let now = self.now;
        let link = self.links.get_mut(link);
        link.map_or(now, |link| link.feed(now, byte))
    }

    /// The next byte that the transmitter of an open link has sent.
    pub fn fetch_link(&mut self, link: usize) -> Option<LineByte> {
        self.links.get_mut(link)?.fetch(self.now)
    }

    /// When the next byte of an open link can be fetched; `None` where none is under way.
    #[must_use]
    pub fn next_fetch(&self, link: usize) -> Option<Instant> {
        let next = self.links.get(link)?.next_sent();
        (next < Instant::NEVER).then_some(next)
    }

    /// When the byte on the last link reaches the master; `None` where there is none. One that is not yet there needs a byte time at
    /// least.
    #[must_use]
    pub fn next_home(&self) -> Option<Instant> {
        let next = self.links.last()?.next_arrival();
        (next < Instant::NEVER).then_some(next)
    }

    /// Begins another conversation. It resets the byte counts and discards records, faults whose byte has not come,
    /// and received bytes that were not fetched. Time and drives go on.
    pub fn begin(&mut self) {
        self.end_groups(|_| true);
        self.links.iter_mut().for_each(Link::begin);
        self.nodes.iter_mut().for_each(RingNode::begin);
        self.inbox.clear();
    }

    /// Its links and nodes, where nothing is left to be done for any of them: no drive is in a group, the master has nothing to send, and
    /// every byte has been fetched.
    pub(crate) fn at_rest(&self) -> Option<(&[Link], &[RingNode<D>])> {
        let rests = self.groups.is_empty() && self.outbox.is_empty() && self.inbox.is_empty();
        rests.then_some((&self.links, &self.nodes))
    }

    /// How many drives there are.
    #[must_use]
    pub fn size(&self) -> RingSize {
        self.size
    }

    /// The rate of its line.
    #[must_use]
    pub const fn rate(&self) -> Rate {
        self.rate
    }

    /// How long a byte takes on this line.
    #[must_use]
    pub fn byte_time(&self) -> Span {
        self.rate.byte_time()
    }

    /// The time up to which everything has happened.
    #[must_use]
    pub fn now(&self) -> Instant {
        self.now
    }

    /// Drive `k`, if the ring has it.
    #[must_use]
    pub fn drive(&self, k: u8) -> Option<&D> {
        let place = self.place(k)?;
        let device = self.nodes.get(place)?.device();
        let inside = |group: &&Group| group.places().contains(&place);
        let Some(group) = self.groups.iter().find(inside) else {
            return Some(device);
        };
        let views = || vec![OnceLock::new(); self.nodes.len()];
        let view = self.views.get_or_init(views).get(place)?;
        Some(view.get_or_init(|| {
            let mut device = Box::new(device.clone());
            group.show(place, self.now, &mut *device);
            device
        }))
    }

    /// Drive `k`, if the ring has it.
    pub fn drive_mut(&mut self, k: u8) -> Option<&mut D> {
        let place = self.place(k)?;
        self.free_place(place);
        Some(self.nodes.get_mut(place)?.device_mut())
    }

    /// Whether drive `k` has power.
    #[must_use]
    pub fn powered(&self, k: u8) -> bool {
        let node = self.place(k).and_then(|place| self.nodes.get(place));
        node.is_some_and(RingNode::powered)
    }

    fn place(&self, k: u8) -> Option<usize> {
        self.size.first().checked_sub(k).map(usize::from)
    }

    /// Lets the master send `bytes` one after another, behind what it already has to send and not
    /// before `not_before`.
    pub fn send(&mut self, not_before: Instant, bytes: &[u8]) {
        self.outbox
            .extend(bytes.iter().map(|&byte| (not_before, byte)));
        let start = self.sent_by.max(not_before).max(self.now);
        self.sent_by = start + self.byte_time() * bytes.len() as u64;
    }

    /// When the master will have sent everything that it has to send.
    #[must_use]
    pub fn sent_by(&self) -> Instant {
        self.sent_by
    }

    /// The next byte that has reached the master.
    pub fn receive(&mut self) -> Option<LineByte> {
        self.inbox.pop_front()
    }

    /// Arms a fault for the `byte`-th byte on link `link` (0 is the master's outgoing one).
    pub fn arm_link(&mut self, link: usize, byte: u64, fault: LinkFault) {
        self.free_link(link);
        if let Some(link) = self.links.get_mut(link) {
            link.arm(byte, fault);
        }
    }

    /// Arms a fault for the `byte`-th byte on drive `k`'s inbound link, lost ones included.
    pub fn arm_drive(&mut self, k: u8, byte: u64, fault: DriveFault) {
        if let Some(place) = self.place(k) {
            self.free_place(place);
            self.nodes[place].arm(byte, fault);
        }
    }

    /// Arms a fault for the first byte on the master's outgoing link that is sent behind all that are queued now.
    pub fn arm_behind_queued(&mut self, fault: LinkFault) {
        let queued = self.outbox.len() as u64;
        if let Some(first) = self.links.first_mut() {
            first.arm(first.transmitted() + queued + 1, fault);
        }
    }

    /// Lets a fault happen to link `link` now. A fault that needs a byte waits for the next one.
    pub fn suffer_link(&mut self, link: usize, fault: LinkFault) {
        let now = self.now;
        self.free_link(link);
        let Some(link) = self.links.get_mut(link) else {
            return;
        };
        match fault {
            LinkFault::Cut => link.cut(now),
            LinkFault::Join => link.join(),
            LinkFault::Break(span) => link.hold(now, span),
            fault => link.arm(link.transmitted() + 1, fault),
        }
    }

    /// Lets a fault happen to drive `k` now.
    pub fn suffer_drive(&mut self, k: u8, fault: DriveFault) {
        if let Some(place) = self.place(k) {
            self.free_place(place);
            self.nodes[place].suffer(fault, self.now, &mut self.links[place + 1]);
        }
    }

    /// The faults on links whose byte never came: link, byte, fault.
    pub fn unused_link_faults(&self) -> impl Iterator<Item = (usize, u64, LinkFault)> + '_ {
        self.links.iter().enumerate().flat_map(|(i, link)| {
            link.waiting_faults()
                .map(move |(byte, fault)| (i, byte, fault))
        })
    }

    /// The faults in drives whose byte never came: drive, byte, fault.
    pub fn unused_drive_faults(&self) -> impl Iterator<Item = (u8, u64, DriveFault)> + '_ {
        (0u8..).zip(&self.nodes).flat_map(|(i, node)| {
            let drive = self.size.first() - i;
            node.waiting_faults()
                .map(move |(byte, fault)| (drive, byte, fault))
        })
    }

    /// Whether something is still under way that goes back to a byte of the master's.
    #[must_use]
    pub fn busy(&self) -> bool {
        let grouped = self.groups.iter().any(Group::busy);
        grouped
            || !self.outbox.is_empty()
            || self
                .outer()
                .any(|link| self.links[link].carries_solicited())
    }

    /// The links that are not inside of a group, by the place to which they lead.
    fn outer(&self) -> impl Iterator<Item = usize> + '_ {
        let mut groups = self.groups.iter().map(Group::places).peekable();
        let mut place = 0;
        std::iter::from_fn(move || {
            let here = place;
            let group = groups.next_if(|group| group.start == here);
            place = group.map_or(here + 1, |group| group.end);
            (here < self.links.len()).then_some(here)
        })
    }

    /// When something happens next; `None` when nothing ever will unless the master sends.
    #[must_use]
    pub fn next_event(&self) -> Option<Instant> {
        let master = self.outbox.front().map_or(Instant::NEVER, |(at, _)| {
            (*at).max(self.links[0].line_free()).max(self.now)
        });
        let to_master = self.links.last().map_or(Instant::NEVER, Link::next_arrival);
        // A drive in a group has no deadline.
        let of_nodes = self.outer().filter_map(|place| {
            let [inbound, outbound] = self.links.get(place..place + 2)? else {
                return None;
            };
            Some(self.nodes[place].next_event(inbound, outbound))
        });
        let of_groups = self.groups.iter().map(|group| group.next_arrival(self.now));
        let next = of_nodes
            .chain(of_groups)
            .fold(master.min(to_master), Instant::min);
        (next < Instant::NEVER).then_some(next)
    }

    /// Lets everything happen up to and including `until`.
    pub fn run_until(&mut self, until: Instant) {
        self.keep_views();
        let mut walked = self.now;
        while let Some(next) = self.next_event().filter(|&next| next <= until) {
            walked = until.min(next + self.byte_time() * BYTES_A_WALK);
            self.walk(walked);
        }
        if walked < until {
            // Nothing on the bus; but devices have a life of their own.
            self.walk(until);
        }
        self.now = self.now.max(until);
    }

    /// Walks the ring once: every drive does all that is due up to `until`.
    fn walk(&mut self, until: Instant) {
        if self.next_groups.is_some_and(|at| at <= self.now) {
            self.form_groups();
        }
        self.feed(until);
        let (mut place, mut index) = (0, 0);
        while place < self.nodes.len() {
            let group = self.groups.get_mut(index);
            if let Some(group) = group.filter(|group| group.places().start == place) {
                let places = group.places();
                let nodes = &mut self.nodes[places.clone()];
                let links = &mut self.links[place..=places.end];
                match group.run(nodes, links, until) {
                    Ok(()) => (place, index) = (places.end, index + 1),
                    Err(end) => self.groups.remove(index).end(nodes, links, end),
                }
            } else {
                if let [inbound, outbound] = &mut self.links[place..place + 2] {
                    self.nodes[place].run(inbound, outbound, until);
                }
                place += 1;
            }
        }
        if let Some(last) = self.links.last_mut() {
            while last.next_arrival() <= until
                && let Some(byte) = last.take()
            {
                self.inbox.push_back(byte);
            }
        }
        self.now = self.now.max(until);
    }

    /// Puts on the wire what the master starts to send up to `until`.
    fn feed(&mut self, until: Instant) {
        while let Some(&(not_before, byte)) = self.outbox.front() {
            let start = not_before.max(self.now);
            if start.max(self.links[0].line_free()) > until {
                return;
            }
            self.links[0].transmit(start, byte, true);
            self.outbox.pop_front();
        }
    }

    /// How many bytes have come to the end of link `link` since the conversation began; 0 where the ring has no such link.
    #[must_use]
    pub fn arrived(&self, link: usize) -> u64 {
        let inside = |group: &&Group| group.places().skip(1).any(|place| place == link);
        let group = self.groups.iter().find(inside);
        let grouped = group.map_or(0, |group| group.arrived(link, self.now) as u64);
        self.links.get(link).map_or(0, Link::arrived) + grouped
    }

    /// How many bytes all links together have carried.
    #[must_use]
    pub fn carried(&self) -> u64 {
        let grouped = self.groups.iter().map(|group| group.carried(self.now));
        self.links.iter().map(Link::arrived).chain(grouped).sum()
    }

    /// What has happened so far.
    #[must_use]
    pub fn trace(&self) -> Trace {
        let drives = self.size.drives();
        let end = |place: usize| u8::try_from(place).ok().and_then(|p| drives.checked_sub(p));
        let channels = (0..self.links.len()).map(|i| {
            let from = end(i).filter(|&k| k < drives);
            let carried = match self.groups.is_empty() {
                true => self.links[i].log().collect(),
                false => self.carried_by(i).into_iter().flatten().collect(),
            };
            Channel::of_octets(from, end(i + 1), carried)
        });
        let remarks = self.nodes.iter().flat_map(|node| node.remarks().to_vec());
        let mut remarks: Vec<_> = remarks.collect();
        remarks.sort_by_key(|remark| remark.at);
        Trace {
            stations: drives,
            channels: channels.collect(),
            remarks,
            seams: Vec::new(),
        }
    }
}
