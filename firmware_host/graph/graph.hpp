#pragma once
// Every node of the system and the arrows between them. graph.cpp reads as the block diagram.
//
// The nodes are stepped by a schedule (firmware_host/schedule): all from one thread (lockstep), each from its
// own (threaded), or as a recording says (recorded). The arrows are in fixed memory and nobody waits on them.
// Nothing on the flight path (sensor, propagate, track, smooth, mesh) allocates or locks once the graph is
// built.
//
// IMU samples go to their readers at once. `track` and `smooth` take those not later than the frame that they
// work on, so that a frame never sees samples from beyond its stamp. From a log they come before the frame;
// from devices they may come after it, and `track` waits for them, not longer than
// GraphOptions::sample_patience.

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware_host/graph/log_node.hpp"
#include "firmware_host/graph/loop_node.hpp"
#include "firmware_host/graph/mapping_node.hpp"
#include "firmware_host/graph/mesh_node.hpp"
#include "firmware_host/graph/propagate_node.hpp"
#include "firmware_host/graph/record_node.hpp"
#include "firmware_host/graph/sensor_node.hpp"
#include "firmware_host/graph/smooth_node.hpp"
#include "firmware_host/graph/track_node.hpp"

namespace swiftlet {

class MemoryTable;

class Graph {
 public:
  /// `settings` and `log` outlive it.
  Graph(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunObserver& observer,
        const GraphOptions& options);
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  /// Before the run: one node more, whose maker connects it.
  template <typename T>
  T& add(std::unique_ptr<T> node) {
    T& added = *node;
    nodes_.push_back(node.get());
    added_.push_back(std::move(node));
    return added;
  }

  /// In the order of the stream, but the sensors, which have no turn.
  [[nodiscard]] std::span<Node* const> nodes() const { return nodes_; }

  [[nodiscard]] SensorNode& sensors() { return *sensors_; }
  [[nodiscard]] PropagateNode& propagate() { return *propagate_; }
  [[nodiscard]] TrackNode& track() { return *track_; }
  [[nodiscard]] SmoothNode& smooth() { return *smooth_; }
  [[nodiscard]] LogNode& log() { return *log_; }
  /// Null if switched off.
  [[nodiscard]] MeshNode* mesh() { return mesh_.get(); }
  [[nodiscard]] LoopNode* loop() { return loop_.get(); }
  [[nodiscard]] MappingNode* map() { return map_.get(); }
  [[nodiscard]] RecordNode* record() { return record_.get(); }

  /// Any thread: what the supervisor asks of it.
  void look(FlightFacts& facts) const;
  /// After the run: what the nodes counted, found and lost, to the log.
  void report(RunObserver& observer) const;
  /// What was reserved for what, by the constructor.
  void addReservations(MemoryTable& table) const;

 private:
  /// Makes a node and notes what it reserved.
  template <typename T, typename... Arguments>
  std::unique_ptr<T> make(Arguments&&... arguments);
  void connectNodes(const RunObserver& observer);

  GraphContext context_;
  struct Reserved {
    std::string what;
    std::int64_t bytes;
  };
  std::vector<Reserved> reserved_;
  std::vector<Node*> nodes_;
  std::unique_ptr<SensorNode> sensors_;
  std::unique_ptr<PropagateNode> propagate_;
  std::unique_ptr<TrackNode> track_;
  std::unique_ptr<SmoothNode> smooth_;
  std::unique_ptr<MeshNode> mesh_;
  std::unique_ptr<LoopNode> loop_;
  std::unique_ptr<MappingNode> map_;
  std::unique_ptr<LogNode> log_;
  std::unique_ptr<RecordNode> record_;
  std::vector<std::unique_ptr<Node>> added_;
};

}  // namespace swiftlet
