"""Modbus TCP, Modbus/TCP Security and Modbus RTU servers."""
