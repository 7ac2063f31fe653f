#pragma once
// A parallel loop with a bounded number of threads. The result of iteration i must not depend on its thread.

#include <atomic>
#include <thread>
#include <vector>

namespace swiftlet {

/// Calls body(i) for i in [0, count), on `threads` threads (the caller's is one of them).
template <typename Body>
void parallelFor(int count, int threads, const Body& body) {
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int i = next.fetch_add(1); i < count; i = next.fetch_add(1)) body(i);
  };
  std::vector<std::thread> helpers;
  for (int k = 1; k < threads && k < count; ++k) helpers.emplace_back(work);
  work();
  for (std::thread& helper : helpers) helper.join();
}

}  // namespace swiftlet
