#pragma once
// A node of the graph: a stage with its arrow ends, stepped by a schedule.
//
// In turn() a node takes what is queued on its arrows, at most one frame, and returns whether it did
// anything. It is done when the nodes before it are done and nothing is queued. A schedule calls turn() from
// one thread: all nodes from the same thread (lockstep, recorded), or each from its own (threaded).
//
// A new node needs a class in its own file, its arrows in graph.cpp, and its file in the CMake list.

#include <atomic>
#include <cstdint>
#include <map>
#include <span>
#include <string>

#include "estimator/core/fixed_vector.hpp"
#include "firmware_host/graph/port.hpp"
#include "firmware_host/realtime/doorbell.hpp"
#include "firmware_host/supervisor/heartbeat.hpp"

namespace swiftlet {

struct RunStatistics;

/// Real-time priority of a node that runs on its own thread.
enum class Rank : std::uint8_t { kSensor, kPropagate, kTrack, kSmooth, kMesh, kLow };

class Node {
 public:
  Node(const char* name, Rank rank) : name_(name), rank_(rank) {}
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  virtual ~Node() = default;

  /// Literal text; the thread's name.
  [[nodiscard]] const char* name() const { return name_; }
  [[nodiscard]] Rank rank() const { return rank_; }

  /// Returns false if there was nothing to do.
  virtual bool turn() = 0;
  /// After the run: adds what it counted.
  virtual void report(RunStatistics& /*statistics*/) const {}
  /// At the end: adds what its arrows lost, by counter.
  virtual void addLosses(std::map<std::string, std::uint64_t>& losses) const;

  /// Any thread: the node has finished; no other node waits for it.
  [[nodiscard]] bool done() const { return done_.load(std::memory_order_acquire); }
  /// Any thread: the node's thread has ended early or is stuck. Nodes behind it end as if it had finished.
  void abandon() {
    abandoned_.store(true, std::memory_order_relaxed);
    finish();
  }
  /// Any thread, once done(): the node was abandoned before it had finished.
  [[nodiscard]] bool wasAbandoned() const { return abandoned_.load(std::memory_order_relaxed); }
  /// Called by the schedule at the end: the thread is stuck and may continue at any time, so nothing of the
  /// node may be read.
  void leaveBehind() { left_behind_ = true; }
  [[nodiscard]] bool isLeftBehind() const { return left_behind_; }

  /// Beats of the node's own thread, if it has one.
  [[nodiscard]] Heartbeat& heart() { return heart_; }
  /// Rung when something has arrived for the node.
  [[nodiscard]] Doorbell& bell() { return bell_; }
  /// Rings the readers that must look after a turn of this node.
  void wakeReaders() {
    for (Node* reader : woken_) reader->bell().ring();
  }

 protected:
  void finish() { done_.store(true, std::memory_order_release); }
  /// Whether the nodes before this one are done. Ask before looking at the arrows; if they are then empty,
  /// nothing more will arrive.
  [[nodiscard]] bool inputEnded() const;

 private:
  friend class In;
  friend void connect(Node& writer, In& in);

  static constexpr std::size_t kMostArrows = 12;

  const char* name_;
  Rank rank_;
  std::atomic<bool> done_{false}, abandoned_{false};
  bool left_behind_ = false;
  Heartbeat heart_;
  Doorbell bell_;
  FixedVector<In*, kMostArrows> ins_;
  FixedVector<Node*, kMostArrows> before_;
  FixedVector<Node*, kMostArrows> woken_;
};

}  // namespace swiftlet
