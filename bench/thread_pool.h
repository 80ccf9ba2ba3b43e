// A fixed pool of threads for FddpOpts::threads: made once, outside any control period; the calling thread is the first of them.
#ifndef BENCH_THREAD_POOL_H_
#define BENCH_THREAD_POOL_H_

#include "controller/fddp/fddp.h"

#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

namespace engram::bench {

class ThreadPool {
 public:
  explicit ThreadPool(int threads) {
    for (int i = 1; i < threads; ++i) workers_.emplace_back([this, i] { work(i); });
  }
  ~ThreadPool() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ends_ = true;
      ++round_;
    }
    starts_.notify_all();
    for (std::thread& worker : workers_) worker.join();
  }
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  FddpThreads threads() { return {int(workers_.size()) + 1, &ThreadPool::run, this}; }

 private:
  using Task = void (*)(void* context, int thread);

  static void run(void* self, Task task, void* context) {
    auto& pool = *static_cast<ThreadPool*>(self);
    {
      const std::lock_guard<std::mutex> lock(pool.mutex_);
      pool.task_ = task;
      pool.context_ = context;
      pool.busy_ = int(pool.workers_.size());
      ++pool.round_;
    }
    pool.starts_.notify_all();
    task(context, 0);
    std::unique_lock<std::mutex> lock(pool.mutex_);
    pool.done_.wait(lock, [&] { return pool.busy_ == 0; });
  }

  void work(int thread) {
    for (long seen = 0;;) {
      std::unique_lock<std::mutex> lock(mutex_);
      starts_.wait(lock, [&] { return round_ != seen; });
      seen = round_;
      if (ends_) return;
      lock.unlock();
      task_(context_, thread);
      lock.lock();
      if (--busy_ == 0) done_.notify_one();
    }
  }

  std::vector<std::thread> workers_;
  std::mutex mutex_;
  std::condition_variable starts_, done_;
  Task task_ = nullptr;
  void* context_ = nullptr;
  int busy_ = 0;
  long round_ = 0;
  bool ends_ = false;
};

}  // namespace engram::bench
#endif  // BENCH_THREAD_POOL_H_
