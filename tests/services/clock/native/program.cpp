// What the C++ library's waits and random numbers come down to; times in ms since the program began.
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <future>
#include <mutex>
#include <random>
#include <thread>

using namespace std::chrono_literals;

static const auto begin = std::chrono::steady_clock::now();

static void say(const char *what, bool result)
{
    auto passed = std::chrono::steady_clock::now() - begin;
    std::printf("%s %d at %lld\n", what, result, static_cast<long long>(passed / 1ms));
}

int main()
{
    std::mutex mutex;
    std::condition_variable condition;
    std::unique_lock<std::mutex> lock(mutex);
    say("condition", condition.wait_for(lock, 20ms) == std::cv_status::timeout);
    say("until", condition.wait_until(lock, std::chrono::system_clock::now() + 20ms) == std::cv_status::timeout);
    std::thread notifier([&] {
        std::this_thread::sleep_for(10ms);
        std::lock_guard<std::mutex> inner(mutex);
        condition.notify_all();
    });
    say("notified", condition.wait_for(lock, 1s) == std::cv_status::no_timeout);
    lock.unlock();
    notifier.join();
    auto future = std::async(std::launch::async, [] { std::this_thread::sleep_for(30ms); });
    say("early", future.wait_for(10ms) == std::future_status::timeout);
    say("ready", future.wait_for(1s) == std::future_status::ready);
    std::timed_mutex timed;
    timed.lock();
    std::thread([&] { say("locked", timed.try_lock_for(15ms)); }).join();
    std::random_device device;
    std::printf("%x\n", device());
}
