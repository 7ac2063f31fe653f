#include "tests/core/interleaving.hpp"

#include <ucontext.h>

#include <algorithm>
#include <set>

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/asan_interface.h>
#endif

namespace swiftlet::test::model {
namespace {

using detail::Kind;
using detail::Operation;

constexpr int kSetUp = kMaxThreads - 1;
constexpr int kNobody = -1;
constexpr std::size_t kStackBytes = 256 * 1024;

/// What a thread, or the reader of a message, knows: for each cell the oldest message that it may still read,
/// for each thread the events that happened before.
struct View {
  std::array<std::uint16_t, kMaxCells> seen{};
  Clock clock{};

  void join(const View& other) {
    for (std::size_t i = 0; i < seen.size(); ++i) seen[i] = std::max(seen[i], other.seen[i]);
    for (std::size_t i = 0; i < clock.size(); ++i) clock[i] = std::max(clock[i], other.clock[i]);
  }
};

struct Message {
  std::uint64_t value = 0;
  View attached;  ///< all zero under a relaxed store
};

struct Thread {
  ucontext_t context{};
  std::vector<char> stack;
  std::function<void()> body;
  View view;
  Operation next;  ///< announced before it waits for its turn
  bool done = false;
};

/// One choice of a run: between threads, or between the messages that a load may read.
struct Branch {
  int taken = 0;
  int count = 0;
};

class Explorer {
 public:
  Outcome run(const std::function<std::vector<std::function<void()>>()>& begin,
              const std::function<void()>& end, const Mutation& mutation);

  int newCell(std::uint64_t value) {
    const auto cell = cells_.size();
    if (cell >= kMaxCells) std::abort();  // a test that needs more must raise the bound
    cells_.push_back({Message{value, {}}});
    return static_cast<int>(cell);
  }
  std::uint64_t perform(Operation operation, const Place& place);
  Clock tick() {
    View& view = threads_[index(current_)].view;
    ++view.clock[index(current_)];
    return view.clock;
  }
  [[nodiscard]] int currentThread() const { return current_; }
  void fail(const std::string& what) {
    if (outcome_.failure.empty()) outcome_.failure = what;
    stopped_ = true;
    if (current_ != kSetUp) switchToScheduler();  // never comes back
  }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }
  static void enter();

  static void prepare(Thread& thread);
  void start(std::vector<std::function<void()>> bodies);
  int pick();
  void resume(int thread);
  void giveTurn();
  void switchToScheduler() { swapcontext(&threads_[index(current_)].context, &scheduler_); }
  int choose(int count);
  bool nextPath();
  void announce(const Operation& operation);
  std::uint64_t execute(const Operation& operation);
  std::uint64_t executeLoad(const Operation& operation);
  std::uint64_t executeModify(const Operation& operation);
  std::uint64_t readMessage(const Operation& operation, std::size_t message, bool acquire);
  void append(const Operation& operation, std::uint64_t value, const View* passed_on);
  void note(const Operation& operation, const Place& place);

  std::array<Thread, kMaxThreads> threads_;
  ucontext_t scheduler_{};
  int current_ = kSetUp;
  int thread_count_ = 0;
  std::vector<std::vector<Message>> cells_;
  std::vector<Branch> path_;
  std::size_t depth_ = 0;
  unsigned asleep_ = 0;  ///< threads whose next step, taken now, gives a run that was seen before
  bool starting_ = false;
  bool complete_ = false;
  bool stopped_ = false;
  Mutation mutation_;
  std::set<Mutation> met_;
  Outcome outcome_;
};

Explorer& explorer() {
  static Explorer instance;
  return instance;
}

bool writes(const Operation& operation) { return operation.kind != Kind::kLoad; }
bool commute(const Operation& a, const Operation& b) {
  return a.cell != b.cell || (!writes(a) && !writes(b));
}

void Explorer::enter() {
  Explorer& self = explorer();
  self.threads_[index(self.current_)].body();
  self.threads_[index(self.current_)].done = true;
  self.giveTurn();
}

void Explorer::resume(int thread) {
  current_ = thread;
  swapcontext(&scheduler_, &threads_[index(thread)].context);
  current_ = kSetUp;
}

/// From a thread that stands before its next step, or at its end, to the one whose turn it is.
void Explorer::giveTurn() {
  const int from = current_;
  const int to = starting_ ? kNobody : pick();
  if (to == from) return;
  if (to == kNobody) {
    switchToScheduler();
  } else {
    current_ = to;
    swapcontext(&threads_[index(from)].context, &threads_[index(to)].context);
  }
}

/// A stack of its own, on which `enter` runs when the thread is first resumed.
void Explorer::prepare(Thread& thread) {
  thread.stack.resize(kStackBytes);
#if defined(__SANITIZE_ADDRESS__)
  // A run that was given up leaves the marks of its frames behind.
  __asan_unpoison_memory_region(thread.stack.data(), thread.stack.size());
#endif
  getcontext(&thread.context);
  thread.context.uc_stack.ss_sp = thread.stack.data();
  thread.context.uc_stack.ss_size = thread.stack.size();
  thread.context.uc_link = nullptr;
  makecontext(&thread.context, &Explorer::enter, 0);
}

void Explorer::start(std::vector<std::function<void()>> bodies) {
  thread_count_ = static_cast<int>(bodies.size());
  if (thread_count_ > kSetUp) std::abort();
  for (int i = 0; i < thread_count_; ++i) {
    Thread& thread = threads_[index(i)];
    thread.body = std::move(bodies[index(i)]);
    thread.view = threads_[kSetUp].view;
    thread.done = false;
    prepare(thread);
  }
  // Up to the first operation, which is announced and waits.
  starting_ = true;
  for (int i = 0; i < thread_count_ && !stopped_; ++i) resume(i);
  starting_ = false;
}

int Explorer::choose(int count) {
  if (count == 1) return 0;
  if (depth_ == path_.size()) path_.push_back({0, count});
  return path_[depth_++].taken;
}

bool Explorer::nextPath() {
  while (!path_.empty() && path_.back().taken + 1 == path_.back().count) path_.pop_back();
  if (path_.empty()) return false;
  ++path_.back().taken;
  return true;
}

/// Whose step comes next; nobody's when all are through, or when this run only repeats an earlier one.
int Explorer::pick() {
  std::array<int, kMaxThreads> ready{};
  int count = 0;
  complete_ = true;
  for (int i = 0; i < thread_count_; ++i) {
    if (threads_[index(i)].done) continue;
    complete_ = false;
    if ((asleep_ & (1U << index(i))) == 0) ready[index(count++)] = i;
  }
  if (count == 0) return kNobody;
  const int choice = choose(count);
  for (int i = 0; i < choice; ++i) asleep_ |= 1U << index(ready[index(i)]);
  const int thread = ready[index(choice)];
  for (int i = 0; i < thread_count_; ++i) {
    if (!commute(threads_[index(i)].next, threads_[index(thread)].next)) asleep_ &= ~(1U << index(i));
  }
  ++outcome_.steps;
  return thread;
}

void Explorer::announce(const Operation& operation) {
  if (current_ == kSetUp) return;
  threads_[index(current_)].next = operation;
  giveTurn();
}

std::uint64_t Explorer::perform(Operation operation, const Place& place) {
  note(operation, place);
  const bool broken = mutation_.breakage != Breakage::kNone && mutation_.place == place;
  if (broken && mutation_.breakage == Breakage::kNoAcquire)
    operation.acquire = operation.failure_acquires = false;
  if (broken && mutation_.breakage == Breakage::kNoRelease) operation.release = false;
  if (broken && mutation_.breakage == Breakage::kTwoSteps) {
    Operation load = operation;
    load.kind = Kind::kLoad;
    announce(load);
    const std::uint64_t old = execute(load);
    if (operation.compares && old != operation.expected) return old;
    Operation store = operation;
    store.kind = Kind::kStore;
    store.operand = operation.modify(old, operation.operand);
    announce(store);
    execute(store);
    return old;
  }
  announce(operation);
  return execute(operation);
}

void Explorer::note(const Operation& operation, const Place& place) {
  if (current_ == kSetUp) return;
  if (operation.acquire || operation.failure_acquires) met_.insert({Breakage::kNoAcquire, place});
  if (operation.release) met_.insert({Breakage::kNoRelease, place});
  if (operation.kind == Kind::kModify) met_.insert({Breakage::kTwoSteps, place});
}

std::uint64_t Explorer::execute(const Operation& operation) {
  if (operation.kind == Kind::kLoad) return executeLoad(operation);
  if (operation.kind == Kind::kModify) return executeModify(operation);
  append(operation, operation.operand, nullptr);
  return 0;
}

std::uint64_t Explorer::readMessage(const Operation& operation, std::size_t message, bool acquire) {
  View& view = threads_[index(current_)].view;
  const Message& read = cells_[index(operation.cell)][message];
  view.seen[index(operation.cell)] = static_cast<std::uint16_t>(message);
  if (acquire) view.join(read.attached);
  return read.value;
}

std::uint64_t Explorer::executeLoad(const Operation& operation) {
  const std::size_t newest = cells_[index(operation.cell)].size() - 1;
  const std::size_t oldest = threads_[index(current_)].view.seen[index(operation.cell)];
  // The newest first: the sequentially consistent runs come before the stale ones. Set-up and end are ordered
  // with everything.
  const std::size_t back = current_ == kSetUp ? 0 : index(choose(static_cast<int>(newest - oldest) + 1));
  return readMessage(operation, newest - back, operation.acquire);
}

std::uint64_t Explorer::executeModify(const Operation& operation) {
  const std::vector<Message>& messages = cells_[index(operation.cell)];
  const std::size_t newest = messages.size() - 1;
  if (operation.compares) {
    // A failing compare-exchange is a load, and may read an old message whose value differs.
    std::vector<std::size_t> readable = {newest};
    for (std::size_t i = newest; i-- > threads_[index(current_)].view.seen[index(operation.cell)];) {
      if (messages[i].value != operation.expected) readable.push_back(i);
    }
    const std::size_t read = readable[index(choose(static_cast<int>(readable.size())))];
    if (messages[read].value != operation.expected)
      return readMessage(operation, read, operation.failure_acquires);
  }
  const std::uint64_t old = readMessage(operation, newest, operation.acquire);
  const View passed_on = messages[newest].attached;
  append(operation, operation.modify(old, operation.operand), &passed_on);
  return old;
}

void Explorer::append(const Operation& operation, std::uint64_t value, const View* passed_on) {
  std::vector<Message>& messages = cells_[index(operation.cell)];
  tick();
  View& view = threads_[index(current_)].view;
  view.seen[index(operation.cell)] = static_cast<std::uint16_t>(messages.size());
  Message message{value, {}};
  if (passed_on != nullptr) message.attached = *passed_on;
  if (operation.release) message.attached.join(view);
  messages.push_back(message);
}

Outcome Explorer::run(const std::function<std::vector<std::function<void()>>()>& begin,
                      const std::function<void()>& end, const Mutation& mutation) {
  outcome_ = {};
  mutation_ = mutation;
  met_.clear();
  path_.clear();
  stopped_ = false;
  do {
    depth_ = 0;
    cells_.clear();
    threads_[kSetUp].view = {};
    current_ = kSetUp;
    start(begin());
    asleep_ = 0;
    const int first = stopped_ ? kNobody : pick();
    if (first != kNobody) resume(first);
    if (stopped_) break;
    if (!complete_) {
      ++outcome_.cut;
      continue;
    }
    ++outcome_.executions;
    for (int i = 0; i < thread_count_; ++i) threads_[kSetUp].view.join(threads_[index(i)].view);
    end();
  } while (!stopped_ && nextPath());
  outcome_.mutations.assign(met_.begin(), met_.end());
  return outcome_;
}

}  // namespace

std::string Mutation::text() const {
  const char* name = breakage == Breakage::kNoAcquire   ? "without acquire"
                     : breakage == Breakage::kNoRelease ? "without release"
                     : breakage == Breakage::kTwoSteps  ? "in two steps"
                                                        : "unbroken";
  const std::string file = place.file;
  return file.substr(file.find_last_of('/') + 1) + ":" + std::to_string(place.line) + " " + name;
}

void fail(const std::string& what) { explorer().fail(what); }

namespace detail {

int newCell(std::uint64_t value) { return explorer().newCell(value); }
std::uint64_t perform(Operation operation, const Place& place) {
  return explorer().perform(operation, place);
}
Clock tick() { return explorer().tick(); }
int currentThread() { return explorer().currentThread(); }
Outcome explore(const std::function<std::vector<std::function<void()>>()>& begin,
                const std::function<void()>& end, const Mutation& mutation) {
  return explorer().run(begin, end, mutation);
}

}  // namespace detail
}  // namespace swiftlet::test::model
