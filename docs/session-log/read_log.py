"""Reads a session log with the public `mcap` package (pip install mcap): python read_log.py session.mcap"""
import json
import sys

from mcap.reader import make_reader

with open(sys.argv[1], "rb") as file:
    for schema, channel, message in make_reader(file).iter_messages(topics=["/glove/joint_angles", "/gripper/command"]):
        fields = json.loads(message.data)
        what = fields.get("angles", fields)
        print(message.log_time, channel.topic, *(f"{name}={value}" for name, value in what.items()))
