// SPDX-License-Identifier: (GPL-2.0 OR MIT)
/*
 * canpe0 <-> canpe1: two CAN controllers on one bus, with what QEMU's have not: bus-off and a full memory. For Linux 6.1.
 *
 * /sys/kernel/debug/canpe/N: write "off" for bus-off, "full" for a lost frame.
 */
#include <linux/can/dev.h>
#include <linux/can/error.h>
#include <linux/debugfs.h>
#include <linux/module.h>
#include <linux/netdevice.h>
#include <linux/uaccess.h>

#define ENDS 2
struct end {
	struct can_priv can;
	struct net_device *peer;
};
static struct net_device *ends[ENDS];
static struct dentry *folder;
static const struct can_bittiming_const timing = {
	.name = "canpe", .tseg1_min = 1, .tseg1_max = 16, .tseg2_min = 1, .tseg2_max = 8, .sjw_max = 4, .brp_min = 1, .brp_max = 64, .brp_inc = 1,
};

static bool listens(struct net_device *dev)
{
	struct end *e = netdev_priv(dev);

	return netif_running(dev) && e->can.state < CAN_STATE_BUS_OFF;
}

static netdev_tx_t end_xmit(struct sk_buff *skb, struct net_device *dev)
{
	struct can_frame *sent = (struct can_frame *)skb->data, *frame;
	struct end *e = netdev_priv(dev);
	struct sk_buff *heard;

	if (can_dev_dropped_skb(dev, skb))
		return NETDEV_TX_OK;
	if (listens(dev) && listens(e->peer)) {
		heard = alloc_can_skb(e->peer, &frame);
		if (heard) {
			*frame = *sent;
			netif_rx(heard);
		}
	}
	dev->stats.tx_packets++;
	can_put_echo_skb(skb, dev, 0, 0);
	dev->stats.tx_bytes += can_get_echo_skb(dev, 0, NULL);
	return NETDEV_TX_OK;
}

static int end_open(struct net_device *dev)
{
	struct end *e = netdev_priv(dev);
	int error = open_candev(dev);

	if (error)
		return error;
	e->can.state = CAN_STATE_ERROR_ACTIVE;
	netif_start_queue(dev);
	return 0;
}

static int end_stop(struct net_device *dev)
{
	struct end *e = netdev_priv(dev);

	netif_stop_queue(dev);
	e->can.state = CAN_STATE_STOPPED;
	close_candev(dev);
	return 0;
}

static const struct net_device_ops operations = {
	.ndo_open = end_open, .ndo_stop = end_stop, .ndo_start_xmit = end_xmit, .ndo_change_mtu = can_change_mtu,
};

static int set_mode(struct net_device *dev, enum can_mode mode)
{
	struct end *e = netdev_priv(dev);

	if (mode != CAN_MODE_START)
		return -EOPNOTSUPP;
	e->can.state = CAN_STATE_ERROR_ACTIVE;
	netif_wake_queue(dev);
	return 0;
}

static ssize_t happen(struct file *file, const char __user *text, size_t length, loff_t *at)
{
	struct net_device *dev = file->private_data;
	struct end *e = netdev_priv(dev);
	struct can_frame *frame;
	struct sk_buff *skb;
	char word[8] = "";

	if (copy_from_user(word, text, min(length, sizeof(word) - 1)))
		return -EFAULT;
	skb = alloc_can_err_skb(dev, &frame);
	if (!skb)
		return -ENOMEM;
	if (sysfs_streq(word, "off")) {
		frame->can_id |= CAN_ERR_BUSOFF;
		e->can.state = CAN_STATE_BUS_OFF;
		e->can.can_stats.bus_off++;
		can_bus_off(dev);
	} else {
		frame->can_id |= CAN_ERR_CRTL;
		frame->data[1] = CAN_ERR_CRTL_RX_OVERFLOW;
		dev->stats.rx_over_errors++;
	}
	netif_rx(skb);
	return length;
}

static const struct file_operations events = { .owner = THIS_MODULE, .open = simple_open, .write = happen };

static void canpe_exit(void)
{
	int n;

	debugfs_remove_recursive(folder);
	for (n = 0; n < ENDS; n++) {
		unregister_candev(ends[n]);
		free_candev(ends[n]);
	}
}

static int canpe_init(void)
{
	char name[] = "0";
	int n, error;

	folder = debugfs_create_dir("canpe", NULL);
	for (n = 0; n < ENDS; n++) {
		ends[n] = alloc_candev(sizeof(struct end), 1);
		if (!ends[n])
			return -ENOMEM;
	}
	for (n = 0; n < ENDS; n++) {
		struct end *e = netdev_priv(ends[n]);

		e->peer = ends[1 - n];
		e->can.clock.freq = 8000000;
		e->can.bittiming_const = &timing;
		e->can.do_set_mode = set_mode;
		e->can.ctrlmode_supported = CAN_CTRLMODE_LISTENONLY;
		ends[n]->netdev_ops = &operations;
		ends[n]->flags |= IFF_ECHO;
		strscpy(ends[n]->name, n ? "canpe1" : "canpe0", IFNAMSIZ);
		error = register_candev(ends[n]);
		if (error)
			return error;
		name[0] = '0' + n;
		debugfs_create_file(name, 0200, folder, ends[n], &events);
	}
	return 0;
}

module_init(canpe_init);
module_exit(canpe_exit);
MODULE_LICENSE("Dual MIT/GPL");
MODULE_DESCRIPTION("Two CAN controllers on one bus, with bus-off and lost frames");
