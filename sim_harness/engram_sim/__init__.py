"""The harness around the controller, Python side: task series, runs, logs, replay, video and report."""
