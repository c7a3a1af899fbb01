/* controller.c: the control loop of the arm: arm.c is what jaxidl has generated, this is the rest.
 *
 *   controller PORT LOG [WATCHDOG_MS [PRIORITY]]
 *
 * For each reading of the robot it sends a torque and then writes a row of LOG, in the form that
 * `jaxidl learn` reads. The row goes to the file at once: what was written when the program is
 * killed stays readable. Anything that is not as it should be is a safe stop: the robot gets the
 * order to close its brakes, and the program ends with a status that says why.
 */
#define _GNU_SOURCE
#include "arm.h"
#include "packets.h"
#include "task.h"

#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define J ARM_JOINTS
#define HELLOS 100    /* are sent before giving up, ... */
#define HELLO_MS 50   /* one each */
#define MOST_MISSED 5 /* readings in a row: so many are made up, more are a stop */

enum {
    FINISHED = 0,
    UNUSABLE = 2,      /* wrong arguments, no log, no robot */
    SILENT = 3,        /* watchdog: no reading for too long */
    NOT_FINITE = 4,    /* a sensor, or something computed */
    BEYOND_LIMITS = 5, /* position or velocity */
    TOO_MANY_LOST = 6,
    ROBOT_BRAKED = 7
};

static arm_state state;
static double q_desired[J], qd_desired[J]; /* where the policy leads without any dynamics */
static FILE *file;

static double now_us(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static void send_command(int robot, uint32_t flags, int64_t answers, const double tau[J])
{
    command_packet packet;
    memset(&packet, 0, sizeof packet);
    packet.kind = COMMAND;
    packet.flags = flags;
    packet.answers = answers;
    if (tau) memcpy(packet.tau, tau, sizeof packet.tau);
    send(robot, &packet, sizeof packet, 0); /* if it does not arrive, the robot's watchdog acts */
}

/* Say hello until the first reading comes. */
static int meet(int robot)
{
    struct pollfd wait = {0, POLLIN, 0};
    int n;
    wait.fd = robot;
    for (n = 0; n < HELLOS; n++) {
        char byte;
        send_command(robot, HELLO, -1, NULL);
        if (poll(&wait, 1, HELLO_MS) <= 0) continue;
        if (wait.revents & POLLIN) return 1;
        recv(robot, &byte, 1, MSG_DONTWAIT); /* nobody there: takes the error away */
        poll(NULL, 0, HELLO_MS);
    }
    return 0;
}

/* Return 1 for a reading, 0 for another packet, -1 if nothing came in time. */
static int receive(int robot, int watchdog_ms, reading_packet *reading)
{
    struct pollfd wait = {0, POLLIN, 0};
    char bytes[sizeof *reading + 1];
    wait.fd = robot;
    if (poll(&wait, 1, watchdog_ms) <= 0) return -1;
    if (recv(robot, bytes, sizeof bytes, 0) != (ssize_t)sizeof *reading) return 0;
    memcpy(reading, bytes, sizeof *reading);
    return reading->kind == READING;
}

static void heading(void)
{
    const char *names[] = {"q", "qd", "q_desired", "qdd_desired", "tau", "tau_feedback",
                           "tau_feedback_applied", "tau_feedforward"};
    size_t n;
    int j;
    fprintf(file, "time");
    for (n = 0; n < sizeof names / sizeof *names; n++)
        for (j = 0; j < J; j++) fprintf(file, ",%s%d", names[n], j);
    fprintf(file, ",made_up,command_age,interval_us,step_us\n");
    fflush(file);
}

static void row(const double wanted[J], const double tau[J], int made_up, int64_t age,
    double interval, double spent)
{
    const double *columns[] = {state.q, state.qd, wanted, state.qdd_desired, tau,
                               state.tau_learning, state.tau_feedback, state.tau_learned};
    size_t n;
    int j;
    fprintf(file, "%.6f", state.time);
    for (n = 0; n < sizeof columns / sizeof *columns; n++)
        for (j = 0; j < J; j++) fprintf(file, ",%.9g", columns[n][j]);
    fprintf(file, ",%d,%d,%.1f,%.1f\n", made_up, (int)age, interval, spent);
    fflush(file); /* whole rows only, even if this was the last one */
}

/* One control step at a reading q: sense, policy, command, limits. */
static int control(int64_t sequence, const double q[J], double time, double tau[J])
{
    const double *target = goal[sequence / STEPS_EACH];
    double qdd_desired[J];
    int j;
    if (arm_sense(&state, q, time) < 0) return NOT_FINITE;
    for (j = 0; j < J; j++) {
        if (state.q[j] < lowest[j] || state.q[j] > highest[j]) return BEYOND_LIMITS;
        if (fabs(state.qd[j]) > speed_limit[j]) return BEYOND_LIMITS;
        qdd_desired[j] = -(gain[0] * (state.q[j] - target[j]) + gain[1] * state.qd[j]);
    }
    if (arm_command(&state, q_desired, qd_desired, qdd_desired, tau) < 0) return NOT_FINITE;
    for (j = 0; j < J; j++) { /* each part is within the limit, their sum need not be */
        if (tau[j] > drive_limit[j]) tau[j] = drive_limit[j];
        if (tau[j] < -drive_limit[j]) tau[j] = -drive_limit[j];
    }
    return FINISHED;
}

/* Let the desired motion go on by a step. */
static void plan(int64_t sequence)
{
    const double *target = goal[sequence / STEPS_EACH];
    int j;
    for (j = 0; j < J; j++) {
        const double qdd = -(gain[0] * (q_desired[j] - target[j]) + gain[1] * qd_desired[j]);
        q_desired[j] += ARM_DT * qd_desired[j] + 0.5 * ARM_DT * ARM_DT * qdd;
        qd_desired[j] += ARM_DT * qdd;
    }
}

/* Control until the task's end; return why it ended. */
static int loop(int robot, int watchdog_ms)
{
    reading_packet reading;
    double before[J], q[J], wanted[J], tau[J], last = 0, fresh = now_us();
    int64_t done = -1, n, step;
    int j, status;
    memcpy(q_desired, home, sizeof q_desired);
    memset(qd_desired, 0, sizeof qd_desired);
    for (;;) {
        double began, interval, spent;
        const double left_ms = watchdog_ms - 1e-3 * (now_us() - fresh);
        const int got = receive(robot, left_ms > 0 ? (int)ceil(left_ms) : 0, &reading);
        if (got < 0) return SILENT;
        if (got && (reading.flags & BRAKED)) return ROBOT_BRAKED;
        if (!got || reading.sequence <= done) { /* doubled, or overtaken: no sign of life */
            if (left_ms <= 0) return SILENT;
            continue;
        }
        began = fresh = now_us();
        interval = last > 0 ? began - last : 0;
        last = began;
        if (done < 0) {
            arm_init(&state, reading.q);
            memcpy(before, reading.q, sizeof before);
        }
        step = reading.sequence - done;
        if (step - 1 > MOST_MISSED) return TOO_MANY_LOST;
        for (n = 1; n <= step && done + 1 < STEPS; n++) {
            const int made_up = n < step; /* a missing reading is made up between its neighbours */
            const double time = reading.time - (double)(step - n) * ARM_DT;
            for (j = 0; j < J; j++)
                q[j] = before[j] + (reading.q[j] - before[j]) * (double)n / (double)step;
            status = control(done + 1, made_up ? q : reading.q, time, tau);
            if (status) return status;
            done++;
            if (!made_up) send_command(robot, 0, reading.sequence, tau);
            spent = now_us() - began;
            memcpy(wanted, q_desired, sizeof wanted);
            plan(done);
            row(wanted, tau, made_up, reading.sequence - reading.in_force, interval, spent);
        }
        if (done + 1 >= STEPS) return FINISHED;
        memcpy(before, reading.q, sizeof before);
    }
}

static void take_priority(int priority)
{
    struct sched_param how;
    memset(&how, 0, sizeof how);
    how.sched_priority = priority;
    if (sched_setscheduler(0, SCHED_FIFO, &how)) perror("controller: no real-time priority");
    if (mlockall(MCL_CURRENT | MCL_FUTURE)) perror("controller: memory is not locked");
}

int main(int count, char **given)
{
    static char buffer[1 << 16]; /* a row is one write */
    struct sockaddr_in address;
    int robot, status;
    if (count < 3) {
        fprintf(stderr, "usage: controller PORT LOG [WATCHDOG_MS [PRIORITY]]\n");
        return UNUSABLE;
    }
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_port = htons((uint16_t)atoi(given[1]));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    robot = socket(AF_INET, SOCK_DGRAM, 0);
    if (robot < 0 || connect(robot, (struct sockaddr *)&address, sizeof address)) {
        perror("controller: no socket");
        return UNUSABLE;
    }
    file = fopen(given[2], "w");
    if (!file || setvbuf(file, buffer, _IOFBF, sizeof buffer)) {
        perror(given[2]);
        return UNUSABLE;
    }
    heading();
    if (count > 4 && atoi(given[4]) > 0) take_priority(atoi(given[4]));
    if (!meet(robot)) {
        fprintf(stderr, "controller: expected a robot at port %s; got no reading\n", given[1]);
        return UNUSABLE;
    }
    status = loop(robot, count > 3 ? atoi(given[3]) : 20);
    send_command(robot, STOP, -1, NULL); /* a robot without commands falls: brake, whatever it was */
    send_command(robot, STOP, -1, NULL);
    fclose(file);
    close(robot);
    return status;
}
