#include "tests/logs/flight_trap.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include "firmware_host/realtime/flight_thread.hpp"

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace swiftlet {
namespace {

std::atomic<std::uint64_t> heap_calls_of_all{0};

struct Row {
  std::array<char, 16> name{};  ///< as the kernel's: 15 characters
  bool aborts = false;
  std::atomic<std::uint64_t> heap{0}, locks{0}, waits{0}, minor_faults{0}, major_faults{0};
};
std::array<Row, 32> rows;
std::atomic<std::size_t> row_count{0};
std::mutex rows_mutex;  ///< among those that arm

// Initial-exec: the storage is there before any code of the thread runs, and is not allocated on first use.
__attribute__((tls_model("initial-exec"))) thread_local Row* armed = nullptr;
__attribute__((tls_model("initial-exec"))) thread_local rusage at_arming{};

void noteHeap() {
  heap_calls_of_all.fetch_add(1, std::memory_order_relaxed);
  if (armed == nullptr) return;
  armed->heap.fetch_add(1, std::memory_order_relaxed);
  if (armed->aborts) std::abort();
}

void noteLock() {
  if (armed == nullptr) return;
  armed->locks.fetch_add(1, std::memory_order_relaxed);
  if (armed->aborts) std::abort();
}

void noteWait() {
  if (armed != nullptr) armed->waits.fetch_add(1, std::memory_order_relaxed);
}

Row& rowOf(const char* name) {
  const std::lock_guard lock(rows_mutex);
  for (std::size_t i = 0; i < row_count; ++i) {
    if (std::strncmp(rows[i].name.data(), name, rows[i].name.size() - 1) == 0) return rows[i];
  }
  Row& row = rows.at(row_count);
  std::strncpy(row.name.data(), name, row.name.size() - 1);
  const char* aborts = std::getenv("SWIFTLET_TRAP_ABORTS");
  row.aborts = aborts != nullptr && std::strcmp(aborts, name) == 0;
  ++row_count;
  return row;
}

TrapCounts countsOf(const Row& row) {
  return {row.heap.load(), row.locks.load(), row.waits.load(), row.minor_faults.load(),
          row.major_faults.load()};
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

void armTrap(const char* name) {
  Row& row = rowOf(name);
  getrusage(RUSAGE_THREAD, &at_arming);
  armed = &row;
}

void disarmTrap() {
  Row* const row = std::exchange(armed, nullptr);
  if (row == nullptr) return;
  rusage now{};
  getrusage(RUSAGE_THREAD, &now);
  row->minor_faults += static_cast<std::uint64_t>(now.ru_minflt - at_arming.ru_minflt);
  row->major_faults += static_cast<std::uint64_t>(now.ru_majflt - at_arming.ru_majflt);
}

void armAllThreads() {
  FlightThread::watchAll([](const char* thread, bool begins) {
    if (begins) {
      armTrap(thread);
    } else {
      disarmTrap();
    }
  });
}

TrapCounts trapCounts() {
  TrapCounts all;
  for (std::size_t i = 0; i < row_count; ++i) {
    const TrapCounts one = countsOf(rows[i]);
    all = {all.heap + one.heap, all.locks + one.locks, all.waits + one.waits,
           all.minor_faults + one.minor_faults, all.major_faults + one.major_faults};
  }
  return all;
}

std::vector<TrappedThread> trappedThreads() {
  std::vector<TrappedThread> all;
  for (std::size_t i = 0; i < row_count; ++i) all.push_back({rows[i].name.data(), countsOf(rows[i])});
  return all;
}

TrapCounts trapCountsOf(const std::string& name) {
  for (const TrappedThread& thread : trappedThreads()) {
    if (thread.name == name) return thread.counts;
  }
  return {};
}

void resetTrap() {
  for (Row& row : rows) {
    for (auto* count : {&row.heap, &row.locks, &row.waits, &row.minor_faults, &row.major_faults}) *count = 0;
    row.name = {};
  }
  row_count = 0;
}

std::uint64_t heapCallsOfAll() { return heap_calls_of_all.load(); }

}  // namespace swiftlet

extern "C" {

void* malloc(std::size_t bytes) {
  swiftlet::noteHeap();
  return __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  swiftlet::noteHeap();
  return __libc_calloc(count, bytes);
}
void* realloc(void* block, std::size_t bytes) {
  swiftlet::noteHeap();
  return __libc_realloc(block, bytes);
}
void free(void* block) {
  // Giving back counts too: it takes the allocator's lock.
  if (block != nullptr) swiftlet::noteHeap();
  __libc_free(block);
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  swiftlet::noteHeap();
  return __libc_memalign(alignment, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  swiftlet::noteHeap();
  return __libc_memalign(alignment, bytes);
}
int posix_memalign(void** block, std::size_t alignment, std::size_t bytes) {
  swiftlet::noteHeap();
  *block = __libc_memalign(alignment, bytes);
  return *block == nullptr ? ENOMEM : 0;
}

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  static const auto real = swiftlet::next<int (*)(pthread_mutex_t*)>("pthread_mutex_lock");
  swiftlet::noteLock();
  return real(mutex);
}
int pthread_mutex_trylock(pthread_mutex_t* mutex) {
  static const auto real = swiftlet::next<int (*)(pthread_mutex_t*)>("pthread_mutex_trylock");
  swiftlet::noteLock();
  return real(mutex);
}
int pthread_rwlock_rdlock(pthread_rwlock_t* lock) {
  static const auto real = swiftlet::next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_rdlock");
  swiftlet::noteLock();
  return real(lock);
}
int pthread_rwlock_wrlock(pthread_rwlock_t* lock) {
  static const auto real = swiftlet::next<int (*)(pthread_rwlock_t*)>("pthread_rwlock_wrlock");
  swiftlet::noteLock();
  return real(lock);
}
int pthread_cond_wait(pthread_cond_t* condition, pthread_mutex_t* mutex) {
  static const auto real = swiftlet::next<int (*)(pthread_cond_t*, pthread_mutex_t*)>("pthread_cond_wait");
  swiftlet::noteLock();
  return real(condition, mutex);
}
int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex, const timespec* until) {
  static const auto real =
      swiftlet::next<int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*)>("pthread_cond_timedwait");
  swiftlet::noteLock();
  return real(condition, mutex, until);
}

// Calls of the kernel. Sleeping for its own next message is a flight thread's work, and is done in futex and
// clock_nanosleep: they are not here.
ssize_t read(int file, void* to, std::size_t bytes) {
  static const auto real = swiftlet::next<ssize_t (*)(int, void*, std::size_t)>("read");
  swiftlet::noteWait();
  return real(file, to, bytes);
}
ssize_t write(int file, const void* from, std::size_t bytes) {
  static const auto real = swiftlet::next<ssize_t (*)(int, const void*, std::size_t)>("write");
  swiftlet::noteWait();
  return real(file, from, bytes);
}
ssize_t readv(int file, const iovec* parts, int count) {
  static const auto real = swiftlet::next<ssize_t (*)(int, const iovec*, int)>("readv");
  swiftlet::noteWait();
  return real(file, parts, count);
}
ssize_t writev(int file, const iovec* parts, int count) {
  static const auto real = swiftlet::next<ssize_t (*)(int, const iovec*, int)>("writev");
  swiftlet::noteWait();
  return real(file, parts, count);
}
ssize_t send(int socket, const void* from, std::size_t bytes, int flags) {
  static const auto real = swiftlet::next<ssize_t (*)(int, const void*, std::size_t, int)>("send");
  swiftlet::noteWait();
  return real(socket, from, bytes, flags);
}
ssize_t sendto(int socket, const void* from, std::size_t bytes, int flags, const sockaddr* to,
               socklen_t size) {
  static const auto real =
      swiftlet::next<ssize_t (*)(int, const void*, std::size_t, int, const sockaddr*, socklen_t)>("sendto");
  swiftlet::noteWait();
  return real(socket, from, bytes, flags, to, size);
}
ssize_t sendmsg(int socket, const msghdr* message, int flags) {
  static const auto real = swiftlet::next<ssize_t (*)(int, const msghdr*, int)>("sendmsg");
  swiftlet::noteWait();
  return real(socket, message, flags);
}
ssize_t recv(int socket, void* to, std::size_t bytes, int flags) {
  static const auto real = swiftlet::next<ssize_t (*)(int, void*, std::size_t, int)>("recv");
  swiftlet::noteWait();
  return real(socket, to, bytes, flags);
}
ssize_t recvfrom(int socket, void* to, std::size_t bytes, int flags, sockaddr* from, socklen_t* size) {
  static const auto real =
      swiftlet::next<ssize_t (*)(int, void*, std::size_t, int, sockaddr*, socklen_t*)>("recvfrom");
  swiftlet::noteWait();
  return real(socket, to, bytes, flags, from, size);
}
ssize_t recvmsg(int socket, msghdr* message, int flags) {
  static const auto real = swiftlet::next<ssize_t (*)(int, msghdr*, int)>("recvmsg");
  swiftlet::noteWait();
  return real(socket, message, flags);
}
int poll(pollfd* files, nfds_t count, int milliseconds) {
  static const auto real = swiftlet::next<int (*)(pollfd*, nfds_t, int)>("poll");
  swiftlet::noteWait();
  return real(files, count, milliseconds);
}
int select(int count, fd_set* reads, fd_set* writes, fd_set* faults, timeval* until) {
  static const auto real = swiftlet::next<int (*)(int, fd_set*, fd_set*, fd_set*, timeval*)>("select");
  swiftlet::noteWait();
  return real(count, reads, writes, faults, until);
}
int epoll_wait(int set, epoll_event* events, int most, int milliseconds) {
  static const auto real = swiftlet::next<int (*)(int, epoll_event*, int, int)>("epoll_wait");
  swiftlet::noteWait();
  return real(set, events, most, milliseconds);
}
int connect(int socket, const sockaddr* to, socklen_t size) {
  static const auto real = swiftlet::next<int (*)(int, const sockaddr*, socklen_t)>("connect");
  swiftlet::noteWait();
  return real(socket, to, size);
}
int accept(int socket, sockaddr* from, socklen_t* size) {
  static const auto real = swiftlet::next<int (*)(int, sockaddr*, socklen_t*)>("accept");
  swiftlet::noteWait();
  return real(socket, from, size);
}
int fsync(int file) {
  static const auto real = swiftlet::next<int (*)(int)>("fsync");
  swiftlet::noteWait();
  return real(file);
}

}  // extern "C"
