"""The meaning of the PLC's words on every bus: registers, numbers, leases, orders and answers; one mailbox to the scan thread."""
