#include "pipelines/cli/interrupt.h"

#include <csignal>

namespace hsi4d::cli {

namespace {

volatile std::sig_atomic_t interrupt_requested = 0;
volatile std::sig_atomic_t time_is_up = 0;

extern "C" void note_interrupt(int signal) {
  interrupt_requested = 1;
  std::signal(signal, SIG_DFL);  // the next one is not asked twice
}

extern "C" void note_time_limit(int) { time_is_up = 1; }

/// A signal that whoever started the program wants ignored (a job of a script's in the background, nohup) stays so.
void watch(int signal) {
  if (std::signal(signal, note_interrupt) == SIG_IGN) std::signal(signal, SIG_IGN);
}

void unwatch(int signal) {
  if (std::signal(signal, SIG_DFL) == SIG_IGN) std::signal(signal, SIG_IGN);
}

}  // namespace

InterruptWatch::InterruptWatch() {
  interrupt_requested = 0;
  watch(SIGINT);
  watch(SIGTERM);
}

InterruptWatch::~InterruptWatch() {
  unwatch(SIGINT);
  unwatch(SIGTERM);
}

bool InterruptWatch::requested() { return interrupt_requested != 0; }

TimeLimitWatch::TimeLimitWatch() {
  time_is_up = 0;
  before_ = std::signal(SIGUSR1, note_time_limit);
  sigset_t warning;
  sigemptyset(&warning);
  sigaddset(&warning, SIGUSR1);
  pthread_sigmask(SIG_UNBLOCK, &warning, nullptr);  // one that waited comes now
}

TimeLimitWatch::~TimeLimitWatch() { std::signal(SIGUSR1, before_); }

bool TimeLimitWatch::requested() { return time_is_up != 0; }

}  // namespace hsi4d::cli
