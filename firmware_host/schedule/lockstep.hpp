#pragma once
// The lockstep schedule: one thread runs all nodes as fast as possible. The same log gives the same bytes.

#include "firmware_host/graph/graph.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/interfaces/run_control.hpp"

namespace swiftlet {

/// Hands over the feed's messages one by one and gives every node its turns after each. False: stopped; the
/// run then ends in order with what has arrived. Rethrows an InputError of the log's reader.
bool runLockstep(LogFeed& feed, Graph& graph, const RunControl& control);

/// Gives turns to every node, in the order of the stream, until none has anything to do.
void runAll(Graph& graph);

}  // namespace swiftlet
