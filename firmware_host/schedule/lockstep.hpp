#pragma once
// The lockstep schedule: one thread in place of all, as fast as it goes, the same bytes out for the same log
// in.

#include "firmware_host/graph/graph.hpp"
#include "firmware_host/inputs/log/log_feed.hpp"
#include "firmware_host/interfaces/run_control.hpp"

namespace swiftlet {

/// Hands the feed's messages over one by one and gives every node its turns after each. False when it was
/// stopped; the run then ends in order with what came so far. InputError of the log's reader passes through.
bool runLockstep(LogFeed& feed, Graph& graph, const RunControl& control);

/// Turns for every node in the order of the stream, until none has anything to do.
void runAll(Graph& graph);

}  // namespace swiftlet
