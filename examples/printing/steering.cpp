// The same as steering.py in C++, without a library: g++ -O2 -o steering steering.cpp
#include <sys/ipc.h>
#include <sys/sem.h>
#include <sys/shm.h>
#include <sys/stat.h>

#include <cstdint>
#include <cstdlib>
#include <iomanip>
#include <iostream>
#include <string>

static std::string flag(int argc, char **argv, std::string const &name) {
    for (int i = 1; i < argc; i++) {
        std::string const word{argv[i]};
        if (word.rfind("--" + name + "=", 0) == 0) return word.substr(name.size() + 3);
    }
    std::cerr << "--" << name << "=... is missing\n";
    std::exit(2);
}

static bool change(int semaphore, short by) {  // and with 0 wait for 0
    sembuf operation{0, by, static_cast<short>(by == 0 ? 0 : SEM_UNDO)};
    return semop(semaphore, &operation, 1) == 0;
}

int main(int argc, char **argv) {
    std::string const path = "/tmp/" + flag(argc, argv, "name");
    int const width = std::stoi(flag(argc, argv, "width")), height = std::stoi(flag(argc, argv, "height"));
    int const mutex = semget(ftok(path.c_str(), 2), 1, 0), notified = semget(ftok(path.c_str(), 3), 1, 0);
    void *const memory = shmat(shmget(ftok(path.c_str(), 1), 0, 0), nullptr, SHM_RDONLY);
    if (mutex < 0 || notified < 0 || memory == reinterpret_cast<void *>(-1)) {
        std::cerr << path << " cannot be attached\n";
        return 1;
    }
    auto const *const pixels = static_cast<std::uint8_t const *>(memory);
    while (change(notified, 0) && change(mutex, -1)) {
        std::int64_t sums[2] = {0, 0};  // each hundredth pixel of the left and of the right half
        for (int half = 0; half < 2; half++) {
            for (int n = 0; n < width / 2 * height; n += 100) {
                int const row = n / (width / 2), column = n % (width / 2) + half * (width / 2);
                for (int channel = 0; channel < 3; channel++) sums[half] += pixels[4 * (row * width + column) + channel];
            }
        }
        struct stat token;
        stat(path.c_str(), &token);
        change(mutex, 1);
        std::int64_t const sampled = token.st_mtim.tv_sec * 1000000LL + token.st_mtim.tv_nsec / 1000;
        double const sum = static_cast<double>(sums[0] + sums[1]);
        std::cout << "group_06;" << sampled << ';' << std::setprecision(17) << (sums[0] - sums[1]) / (sum > 1 ? sum : 1)
                  << '\n';
    }
    return 0;
}
