"""The summary of many runs on record: facts, drawings and documents."""
