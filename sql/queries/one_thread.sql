-- While writing: choices among equals do not depend on the machine, and memory stays small.
SET threads = 1;
