/* A time of day that a test can set while a process runs: LD_PRELOAD this, CLOCK_FILE names eight bytes, the seconds
   ahead of the true time. What counts time by itself (monotonic clock, sleeps, timers) goes on as it does on a machine
   whose clock is set; libfaketime 0.9.10 lets clock_nanosleep of an absolute monotonic time fail, Python's time.sleep. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static volatile int64_t *ahead;
static int (*true_gettime)(clockid_t, struct timespec *);

__attribute__((constructor)) static void begin(void)
{
    const char *name = getenv("CLOCK_FILE");
    int file = name ? open(name, O_RDONLY | O_CLOEXEC) : -1;
    true_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    if (file >= 0) {
        void *where = mmap(NULL, sizeof *ahead, PROT_READ, MAP_SHARED, file, 0);
        if (where != MAP_FAILED)
            ahead = where;
        close(file);
    }
}

int clock_gettime(clockid_t clock, struct timespec *out)
{
    if (!true_gettime)
        true_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    int status = true_gettime(clock, out);
    if (status == 0 && ahead && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
        out->tv_sec += *ahead;
    return status;
}

int gettimeofday(struct timeval *out, void *zone)
{
    struct timespec now;
    (void)zone;
    clock_gettime(CLOCK_REALTIME, &now);
    out->tv_sec = now.tv_sec;
    out->tv_usec = now.tv_nsec / 1000;
    return 0;
}

time_t time(time_t *out)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out)
        *out = now.tv_sec;
    return now.tv_sec;
}
