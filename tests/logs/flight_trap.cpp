#include "tests/logs/flight_trap.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdlib>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void __libc_free(void*);
}

namespace swiftlet {
namespace {

std::atomic<std::uint64_t> heap_calls{0};
std::atomic<std::uint64_t> heap_calls_of_all{0};
std::atomic<std::uint64_t> lock_calls{0};
std::atomic<std::uint64_t> wait_calls{0};
// Initial-exec: the storage is there before any code of the thread runs, and is not allocated on first use.
__attribute__((tls_model("initial-exec"))) thread_local bool armed = false;

void noteHeap() {
  heap_calls_of_all.fetch_add(1, std::memory_order_relaxed);
  if (!armed) return;
  heap_calls.fetch_add(1, std::memory_order_relaxed);
  // For the debugger: who was it?
  if (std::getenv("SWIFTLET_TRAP_ABORTS") != nullptr) std::abort();
}

void noteLock() {
  if (!armed) return;
  lock_calls.fetch_add(1, std::memory_order_relaxed);
  if (std::getenv("SWIFTLET_TRAP_ABORTS") != nullptr) std::abort();
}

void noteWait() {
  if (!armed) return;
  wait_calls.fetch_add(1, std::memory_order_relaxed);
  if (std::getenv("SWIFTLET_TRAP_ABORTS") != nullptr) std::abort();
}

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

void armTrap() { armed = true; }
void disarmTrap() { armed = false; }
TrapCounts trapCounts() { return {heap_calls.load(), lock_calls.load(), wait_calls.load()}; }
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
