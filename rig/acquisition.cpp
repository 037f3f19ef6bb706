#include "rig/acquisition.h"

#include <algorithm>
#include <iterator>

namespace plumbline::rig {

namespace {

/// How long one read may wait: bounds how late stop() is noticed.
constexpr std::chrono::milliseconds kReadTimeout{50};

template <class T>
void append(std::vector<T>& to, std::vector<T>& from, std::size_t count) {
  to.insert(to.end(), std::make_move_iterator(from.begin()),
            std::make_move_iterator(from.begin() + static_cast<std::ptrdiff_t>(count)));
}

}  // namespace

Acquisition::Acquisition(std::unique_ptr<SampleSource> source, std::size_t capacity)
    : source_(std::move(source)), capacity_(capacity) {}

Acquisition::~Acquisition() { stop(); }

Result<void> Acquisition::start() {
  stop();
  if (auto opened = source_->open(); !opened) return opened;
  failure_.reset();
  stopping_ = false;
  thread_ = std::thread([this] { run(); });
  return {};
}

void Acquisition::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  room_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Acquisition::run() {
  for (;;) {
    auto batch = source_->read(kReadTimeout);
    std::unique_lock lock(mutex_);
    statistics_ = source_->statistics();
    statistics_.queue_drops = queue_drops_;
    if (batch && source_->recorded()) {
      // A log can wait for its reader; a node cannot.
      room_.wait(lock, [&] {
        return stopping_ || queue_.samples.empty() ||
               queue_.samples.size() + batch->samples.size() <= capacity_;
      });
    }
    if (stopping_) return;
    if (!batch) {
      failure_ = batch.error();
    } else {
      store(*batch);
    }
    const bool done = !batch || batch->ended;
    lock.unlock();
    arrived_.notify_one();
    if (done) return;
  }
}

void Acquisition::store(SampleBatch& batch) {
  const std::size_t room = capacity_ - std::min(capacity_, queue_.samples.size());
  const std::size_t kept =
      source_->recorded() ? batch.samples.size() : std::min(room, batch.samples.size());
  append(queue_.samples, batch.samples, kept);
  queue_drops_ += batch.samples.size() - kept;
  statistics_.queue_drops = queue_drops_;
  const std::size_t covariate_room = capacity_ - std::min(capacity_, queue_.covariates.size());
  append(queue_.covariates, batch.covariates, std::min(covariate_room, batch.covariates.size()));
  queue_.ended = queue_.ended || batch.ended;
  queue_.empty_at = std::max(queue_.empty_at, batch.empty_at);
}

Result<SampleBatch> Acquisition::take(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  const auto something = [&] {
    return !queue_.samples.empty() || !queue_.covariates.empty() || queue_.ended ||
           failure_.has_value();
  };
  arrived_.wait_for(lock, timeout, something);
  const bool data = !queue_.samples.empty() || !queue_.covariates.empty() || queue_.ended;
  if (!data && failure_) return fail(*failure_);
  SampleBatch batch = std::exchange(queue_, SampleBatch{});
  queue_.ended = batch.ended;  // an end stays one
  lock.unlock();
  room_.notify_one();
  return batch;
}

void Acquisition::discard() {
  {
    const std::lock_guard lock(mutex_);
    queue_.samples.clear();
    queue_.covariates.clear();
  }
  room_.notify_one();
}

SourceStatistics Acquisition::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

}  // namespace plumbline::rig
