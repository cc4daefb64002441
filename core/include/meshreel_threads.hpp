/* A host for meshreel.h in C++11: memory from the heap, and a thread pool.

       meshreel::Host host;
       meshreel_open(&source, host.get(), &file, &error);

   The host must outlive the files opened with it. Any number of threads may decode with one host at
   the same time; they share its threads. */

#ifndef MESHREEL_THREADS_HPP
#define MESHREEL_THREADS_HPP

#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "meshreel.h"

namespace meshreel {

class Host {
  public:
    /* `n_threads` includes the calling thread; 0: one per core. Fewer are used if the system cannot
       start as many. `memory_limit` as in meshreel_host. */
    explicit Host(unsigned n_threads = 0, uint64_t memory_limit = 0) : host_() {
        n_threads = n_threads ? n_threads : std::thread::hardware_concurrency();
        try {
            while (workers_.size() + 1 < n_threads) {
                workers_.emplace_back(&Host::work, this);
            }
        } catch (const std::system_error &) {
        }
        host_.user = this;
        host_.allocate = &Host::allocate;
        host_.release = &Host::release;
        host_.run = &Host::run;
        host_.n_threads = static_cast<uint32_t>(workers_.size() + 1);
        host_.memory_limit = memory_limit;
    }

    ~Host() {
        {
            std::lock_guard<std::mutex> lock(mutex_);
            is_stopping_ = true;
        }
        has_work_.notify_all();
        for (std::thread &worker : workers_) {
            worker.join();
        }
    }

    Host(const Host &) = delete;
    Host &operator=(const Host &) = delete;

    const meshreel_host *get() const { return &host_; }

  private:
    struct Job {
        void (*task)(void *shared, uint32_t i);
        void *shared;
        uint32_t n_tasks, n_begun, n_done;
    };

    static const size_t alignment = 64;

    /* The address of the allocation is stored in front of the aligned block. */
    static void *allocate(void *, size_t size) {
        const size_t overhead = alignment + sizeof(void *);
        void *allocation = size <= SIZE_MAX - overhead ? std::malloc(size + overhead) : nullptr;
        if (!allocation) {
            return nullptr;
        }
        uintptr_t address = reinterpret_cast<uintptr_t>(allocation);
        uintptr_t aligned = (address + overhead) / alignment * alignment;
        reinterpret_cast<void **>(aligned)[-1] = allocation;
        return reinterpret_cast<void *>(aligned);
    }

    static void release(void *, void *memory, size_t) {
        std::free(static_cast<void **>(memory)[-1]);
    }

    static void run(void *user, void (*task)(void *shared, uint32_t i), void *shared,
                    uint32_t n_tasks) {
        Host &host = *static_cast<Host *>(user);
        Job job = {task, shared, n_tasks, 0, 0};
        std::unique_lock<std::mutex> lock(host.mutex_);
        host.jobs_.push_back(&job);
        host.has_work_.notify_all();
        while (job.n_begun < job.n_tasks) {
            host.run_task(job, lock);
        }
        host.is_done_.wait(lock, [&job] { return job.n_done == job.n_tasks; });
    }

    /* Run one task, with the lock released. */
    void run_task(Job &job, std::unique_lock<std::mutex> &lock) {
        uint32_t i = job.n_begun++;
        if (job.n_begun == job.n_tasks) {
            for (size_t k = 0; k < jobs_.size(); k++) {
                if (jobs_[k] == &job) {
                    jobs_.erase(jobs_.begin() + static_cast<std::ptrdiff_t>(k));
                    break;
                }
            }
        }
        lock.unlock();
        job.task(job.shared, i);
        lock.lock();
        if (++job.n_done == job.n_tasks) {
            is_done_.notify_all();
        }
    }

    void work() {
        std::unique_lock<std::mutex> lock(mutex_);
        for (;;) {
            has_work_.wait(lock, [this] { return is_stopping_ || !jobs_.empty(); });
            if (is_stopping_) {
                return;
            }
            run_task(*jobs_.front(), lock);
        }
    }

    meshreel_host host_;
    std::mutex mutex_;
    std::condition_variable has_work_, is_done_;
    std::deque<Job *> jobs_; /* jobs with tasks that have not begun */
    std::vector<std::thread> workers_;
    bool is_stopping_ = false;
};

} // namespace meshreel

#endif
