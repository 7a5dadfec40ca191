// SPDX-License-Identifier: (GPL-2.0 OR MIT)
/*
 * ttyPE0 <-> ttyPE1, ttyPE2 <-> ttyPE3, ttyPE4 <-> ttyPE5: serial ports joined by null modem cables, with the bits of a real line: rate, parity and stop
 * bits of both ends are honoured, so a byte sent with the other parity arrives as TTY_PARITY. For Linux 6.1.
 *
 * /sys/kernel/debug/ttype/N/ of each port:
 *   fault     write "parity|frame|break|overrun|lose AFTER": what the port receives AFTER bytes from now (0 = the next)
 *   latency   microseconds for which received bytes are collected, as a USB adapter does
 *   hasty     1: a drain does not wait for the last byte, as some USB adapters do
 *   stubborn  1: the driver keeps the parity and says so; 2: it keeps it and claims to have changed it
 */
#include <linux/debugfs.h>
#include <linux/hrtimer.h>
#include <linux/kfifo.h>
#include <linux/module.h>
#include <linux/serial.h>
#include <linux/tty.h>
#include <linux/tty_driver.h>
#include <linux/tty_flip.h>
#include <linux/uaccess.h>

#define PORTS 6
static const char *const kinds[] = { "none", "parity", "frame", "break", "overrun", "lose" };
enum kind { NONE, PARITY, FRAME, BREAK, OVERRUN, LOSE };

struct pe {
	struct tty_port port;
	struct pe *peer;
	spinlock_t lock;
	DECLARE_KFIFO(tx, u8, 4096);
	struct hrtimer timer;
	struct delayed_work push;
	bool busy, breaking;		/* a byte is on the line; the line is held at 0 */
	u8 byte;			/* what is on the line */
	speed_t sent_baud;
	tcflag_t cflag, iflag;		/* what the "chip" really does */
	speed_t baud;
	unsigned int mcr;
	enum kind fault;
	u32 after, latency, hasty, stubborn;
	struct async_icount icount;
};
static struct pe pe[PORTS];
static struct tty_driver *driver;
static struct dentry *folder;

/* The parity bit of a byte; 1 (the stop bit's value) without parity. */
static int parity_bit(tcflag_t cflag, u8 byte)
{
	if (!(cflag & PARENB))
		return 1;
	if (cflag & CMSPAR)
		return !!(cflag & PARODD);
	return (hweight8(byte) & 1) ^ !!(cflag & PARODD);
}

static u64 bit_times(struct pe *p)
{
	return 10 + !!(p->cflag & PARENB) + !!(p->cflag & CSTOPB);
}

/* A byte arrives at this port. The caller holds no lock. */
static void arrive(struct pe *p, u8 byte, int bit, speed_t baud, bool is_break)
{
	enum kind kind = NONE;
	int flag = TTY_NORMAL;

	if (!tty_port_initialized(&p->port) || !(p->cflag & CREAD))
		return;
	if (p->fault != NONE && p->after-- == 0)
		swap(kind, p->fault);
	if (kind == LOSE)
		return;
	p->icount.rx++;
	if (is_break || kind == BREAK) {
		p->icount.brk++;
		byte = 0;
		flag = TTY_BREAK;
		if (p->iflag & IGNBRK)
			return;
	} else if (abs((int)baud - (int)p->baud) > p->baud / 20 || kind == FRAME || (!(p->cflag & PARENB) && !bit)) {
		p->icount.frame++;
		flag = TTY_FRAME;
	} else if (kind == PARITY || ((p->cflag & PARENB) && bit != parity_bit(p->cflag, byte))) {
		p->icount.parity++;
		flag = TTY_PARITY;
	}
	/* As uart_insert_char: without INPCK an error is not looked at; with IGNPAR the byte is dropped. */
	if (flag == TTY_PARITY || flag == TTY_FRAME) {
		if (p->iflag & IGNPAR)
			return;
		if (!(p->iflag & INPCK))
			flag = TTY_NORMAL;
	}
	if (kind == OVERRUN)
		p->icount.overrun++;
	if (!tty_insert_flip_char(&p->port, byte, flag) || (kind == OVERRUN && !tty_insert_flip_char(&p->port, 0, TTY_OVERRUN)))
		p->icount.buf_overrun++;
	if (p->latency)
		schedule_delayed_work(&p->push, usecs_to_jiffies(p->latency));
	else
		tty_flip_buffer_push(&p->port);
}

static void push(struct work_struct *work)
{
	tty_flip_buffer_push(&container_of(to_delayed_work(work), struct pe, push)->port);
}

/* Puts the next byte on the line; the caller holds the lock. */
static bool next(struct pe *p)
{
	p->busy = !p->breaking && kfifo_get(&p->tx, &p->byte);
	if (p->busy) {
		p->sent_baud = p->baud;
		p->icount.tx++;
	}
	return p->busy;
}

/* A byte has left. */
static enum hrtimer_restart left(struct hrtimer *timer)
{
	struct pe *p = container_of(timer, struct pe, timer);
	unsigned long flags;
	bool more;

	/* The parity bit goes out last: who changes the parity before a byte has left changes that of this byte. */
	arrive(p->peer, p->byte, parity_bit(p->cflag, p->byte), p->sent_baud, false);
	spin_lock_irqsave(&p->lock, flags);
	more = next(p);
	if (more)
		hrtimer_add_expires_ns(timer, bit_times(p) * NSEC_PER_SEC / p->baud);	/* without a gap */
	spin_unlock_irqrestore(&p->lock, flags);
	tty_port_tty_wakeup(&p->port);
	return more ? HRTIMER_RESTART : HRTIMER_NORESTART;
}

static void start(struct pe *p)
{
	unsigned long flags;

	spin_lock_irqsave(&p->lock, flags);
	if (!p->busy && next(p))
		hrtimer_start(&p->timer, ns_to_ktime(bit_times(p) * NSEC_PER_SEC / p->baud), HRTIMER_MODE_REL);
	spin_unlock_irqrestore(&p->lock, flags);
}

static int pe_write(struct tty_struct *tty, const unsigned char *bytes, int count)
{
	struct pe *p = tty->driver_data;
	unsigned long flags;

	spin_lock_irqsave(&p->lock, flags);
	count = kfifo_in(&p->tx, bytes, count);
	spin_unlock_irqrestore(&p->lock, flags);
	start(p);
	return count;
}

static unsigned int pe_write_room(struct tty_struct *tty)
{
	struct pe *p = tty->driver_data;

	return kfifo_avail(&p->tx);
}

static unsigned int pe_chars_in_buffer(struct tty_struct *tty)
{
	struct pe *p = tty->driver_data;

	return kfifo_len(&p->tx) + (p->hasty ? 0 : p->busy);
}

static void pe_flush_buffer(struct tty_struct *tty)
{
	struct pe *p = tty->driver_data;
	unsigned long flags;

	spin_lock_irqsave(&p->lock, flags);
	kfifo_reset(&p->tx);
	spin_unlock_irqrestore(&p->lock, flags);
	tty_wakeup(tty);
}

static void pe_set_termios(struct tty_struct *tty, const struct ktermios *old)
{
	struct pe *p = tty->driver_data;
	tcflag_t c = tty->termios.c_cflag;

	if (old && p->stubborn && (old->c_cflag & PARENB)) {
		c = (c & ~(PARODD | CMSPAR)) | (p->cflag & (PARODD | CMSPAR));
		if (p->stubborn == 1)
			tty->termios.c_cflag = c;
	}
	p->cflag = c;
	p->iflag = tty->termios.c_iflag;
	p->baud = tty_get_baud_rate(tty) ?: 9600;
}

static int pe_break(struct tty_struct *tty, int state)
{
	struct pe *p = tty->driver_data;

	if (state && !p->breaking)
		arrive(p->peer, 0, 0, p->baud, true);
	p->breaking = state;
	if (!state)
		start(p);
	return 0;
}

static int pe_tiocmget(struct tty_struct *tty)
{
	struct pe *p = tty->driver_data;
	unsigned int m = p->peer->mcr;

	return p->mcr | (m & TIOCM_RTS ? TIOCM_CTS : 0) | (m & TIOCM_DTR ? TIOCM_DSR | TIOCM_CD : 0);
}

static int pe_tiocmset(struct tty_struct *tty, unsigned int set, unsigned int clear)
{
	struct pe *p = tty->driver_data;

	p->mcr = (p->mcr & ~clear) | set;
	return 0;
}

static int pe_get_icount(struct tty_struct *tty, struct serial_icounter_struct *to)
{
	struct async_icount *i = &((struct pe *)tty->driver_data)->icount;

	*to = (struct serial_icounter_struct){ .rx = i->rx, .tx = i->tx, .frame = i->frame, .overrun = i->overrun,
		.parity = i->parity, .brk = i->brk, .buf_overrun = i->buf_overrun };
	return 0;
}

static int pe_install(struct tty_driver *d, struct tty_struct *tty)
{
	tty->driver_data = &pe[tty->index];
	return tty_port_install(&pe[tty->index].port, d, tty);
}

static int pe_open(struct tty_struct *tty, struct file *file)
{
	return tty_port_open(tty->port, tty, file);
}

static void pe_close(struct tty_struct *tty, struct file *file)
{
	tty_port_close(tty->port, tty, file);
}

static void pe_hangup(struct tty_struct *tty)
{
	tty_port_hangup(tty->port);
}

static const struct tty_operations operations = {
	.install = pe_install, .open = pe_open, .close = pe_close, .hangup = pe_hangup, .write = pe_write,
	.write_room = pe_write_room, .chars_in_buffer = pe_chars_in_buffer, .flush_buffer = pe_flush_buffer,
	.set_termios = pe_set_termios, .break_ctl = pe_break, .tiocmget = pe_tiocmget, .tiocmset = pe_tiocmset,
	.get_icount = pe_get_icount,
};

static int activate(struct tty_port *port, struct tty_struct *tty)
{
	pe_set_termios(tty, NULL);
	return 0;
}

static void dtr_rts(struct tty_port *port, int on)
{
	container_of(port, struct pe, port)->mcr = on ? TIOCM_DTR | TIOCM_RTS : 0;
}

static int carrier_raised(struct tty_port *port)
{
	return !!(container_of(port, struct pe, port)->peer->mcr & TIOCM_DTR);
}

static const struct tty_port_operations port_operations = {
	.activate = activate, .dtr_rts = dtr_rts, .carrier_raised = carrier_raised,
};

static ssize_t fault_write(struct file *file, const char __user *from, size_t count, loff_t *at)
{
	struct pe *p = file->private_data;
	char text[32] = "", name[16];
	unsigned int after = 0;
	int kind;

	if (count >= sizeof(text) || copy_from_user(text, from, count) || sscanf(text, "%15s %u", name, &after) < 1)
		return -EINVAL;
	kind = match_string(kinds, ARRAY_SIZE(kinds), name);
	if (kind < 0)
		return kind;
	p->after = after;
	p->fault = kind;
	return count;
}

static const struct file_operations fault_operations = { .owner = THIS_MODULE, .open = simple_open, .write = fault_write };

static int __init pe_init(void)
{
	int i, error;

	driver = tty_alloc_driver(PORTS, TTY_DRIVER_REAL_RAW | TTY_DRIVER_RESET_TERMIOS);
	if (IS_ERR(driver))
		return PTR_ERR(driver);
	driver->driver_name = "ttype";
	driver->name = "ttyPE";
	driver->type = TTY_DRIVER_TYPE_SERIAL;
	driver->subtype = SERIAL_TYPE_NORMAL;
	driver->init_termios = tty_std_termios;
	driver->init_termios.c_cflag = B9600 | CS8 | CREAD | HUPCL | CLOCAL;
	tty_set_operations(driver, &operations);
	folder = debugfs_create_dir("ttype", NULL);
	for (i = 0; i < PORTS; i++) {
		struct pe *p = &pe[i];
		char name[] = { '0' + i, 0 };
		struct dentry *own = debugfs_create_dir(name, folder);

		tty_port_init(&p->port);
		p->port.ops = &port_operations;
		p->peer = &pe[i ^ 1];
		p->baud = 9600;
		spin_lock_init(&p->lock);
		INIT_KFIFO(p->tx);
		INIT_DELAYED_WORK(&p->push, push);
		hrtimer_init(&p->timer, CLOCK_MONOTONIC, HRTIMER_MODE_REL);
		p->timer.function = left;
		tty_port_link_device(&p->port, driver, i);
		debugfs_create_file("fault", 0200, own, p, &fault_operations);
		debugfs_create_u32("latency", 0600, own, &p->latency);
		debugfs_create_u32("hasty", 0600, own, &p->hasty);
		debugfs_create_u32("stubborn", 0600, own, &p->stubborn);
	}
	error = tty_register_driver(driver);
	if (error) {
		debugfs_remove(folder);
		tty_driver_kref_put(driver);
	}
	return error;
}

/* There is no way out: the guest is switched off when a test is over. */
module_init(pe_init);
MODULE_LICENSE("Dual MIT/GPL");
MODULE_DESCRIPTION("Two serial ports on one cable, with parity errors");
