#pragma once
// Work that comes in numbered parts, on every processor.

#include <algorithm>
#include <atomic>
#include <functional>
#include <thread>
#include <vector>

namespace swiftlet::test {

/// Calls `work` with 0 to count - 1, from several threads.
inline void forEach(int count, const std::function<void(int)>& work) {
  std::atomic<int> next = 0;
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < std::max(1U, std::thread::hardware_concurrency()); ++t) {
    threads.emplace_back([&] {
      for (int i = next++; i < count; i = next++) work(i);
    });
  }
  for (std::thread& t : threads) t.join();
}

}  // namespace swiftlet::test
