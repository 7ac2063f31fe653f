#pragma once
// Every node of the system and the arrows between them. graph.cpp reads as the block diagram.
//
// A schedule (firmware_host/schedule) steps the nodes: all from one thread (lockstep), each from its own
// (threaded), or as a recording says (recorded). Arrows have fixed memory and never block. Once the graph is
// built, nothing on the flight path (sensor, propagate, track, smooth, mesh) allocates or locks.
//
// IMU samples are passed to their readers at once. `track` and `smooth` take only samples up to the stamp of
// their frame, so a frame never uses later samples. In a log these samples precede the frame. From devices
// they may arrive after it: `track` waits for them, but not longer than GraphOptions::sample_patience.

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
  /// `settings` and `observer` outlive the graph.
  Graph(const Rig& rig, const ImuNoise& noise, const Settings& settings, RunObserver& observer,
        const GraphOptions& options);
  ~Graph();
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;

  /// Before the run: adds a node; the caller connects it.
  template <typename T>
  T& add(std::unique_ptr<T> node) {
    T& added = *node;
    nodes_.push_back(node.get());
    added_.push_back(std::move(node));
    return added;
  }

  /// In the order of the stream, without the sensor node, which has no turn.
  [[nodiscard]] std::span<Node* const> nodes() const { return nodes_; }

  [[nodiscard]] SensorNode& sensors() { return *sensors_; }
  [[nodiscard]] PropagateNode& propagate() { return *propagate_; }
  [[nodiscard]] TrackNode& track() { return *track_; }
  [[nodiscard]] SmoothNode& smooth() { return *smooth_; }
  [[nodiscard]] LogNode& log() { return *log_; }
  /// Null if disabled.
  [[nodiscard]] MeshNode* mesh() { return mesh_.get(); }
  [[nodiscard]] LoopNode* loop() { return loop_.get(); }
  [[nodiscard]] MappingNode* map() { return map_.get(); }
  [[nodiscard]] RecordNode* record() { return record_.get(); }

  /// Any thread: adds what the supervisor needs to know.
  void look(FlightFacts& facts) const;
  /// After the run: reports to `observer` what the nodes counted, found and lost.
  void report(RunObserver& observer) const;
  /// Adds what the constructor reserved, by purpose.
  void addReservations(MemoryTable& table) const;

 private:
  /// Makes a node and notes the memory it reserved.
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
