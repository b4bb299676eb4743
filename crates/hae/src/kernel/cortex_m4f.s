@ The map in f32 for Cortex-M4F; arithmetic and layout as the Rust module beside this file says.
@
@ void hae_m4f_f32(const float *words, const float *q, float *y, float *sums, size_t inputs, size_t outputs)
@
@   words   16 lane records of 19 units, then b2
@   sums    room for [outputs][8] floats: lanes 0-7 are stored there, lanes 8-15 added to them, which is the first
@           step of the halving tree
@
@ r0 runs through words from its start to its end. r1 runs through q, r2 through sums; r3-r12 and lr are scratch.
@ Frame: 204 bytes with the saved registers.

        .syntax unified
        .thumb
        .fpu    fpv4-sp-d16

        @ the frame; at sp+0 the 19 hidden units (76 bytes) pass through relu
        .equ    .Lhae_LANE, 76
        .equ    .Lhae_Q, 80
        .equ    .Lhae_Y, 84
        .equ    .Lhae_SUMS, 88
        .equ    .Lhae_CHUNKS, 92              @ inputs / 5
        .equ    .Lhae_REST, 96                @ inputs mod 5
        .equ    .Lhae_OUTPUTS, 100
        .equ    .Lhae_FRAME, 104
        .equ    .Lhae_ARGUMENTS, .Lhae_FRAME + 16*4 + 9*4

        @ Eight weights in one load, each times an input (s\q) onto a hidden unit (s\z).
        .macro  take8 z0, q0, z1, q1, z2, q2, z3, q3, z4, q4, z5, q5, z6, q6, z7, q7
        vldmia  r0!, {s24-s31}
        vmla.f32 s\z0, s24, s\q0
        vmla.f32 s\z1, s25, s\q1
        vmla.f32 s\z2, s26, s\q2
        vmla.f32 s\z3, s27, s\q3
        vmla.f32 s\z4, s28, s\q4
        vmla.f32 s\z5, s29, s\q5
        vmla.f32 s\z6, s30, s\q6
        vmla.f32 s\z7, s31, s\q7
        .endm
        .macro  take7 z0, q0, z1, q1, z2, q2, z3, q3, z4, q4, z5, q5, z6, q6
        vldmia  r0!, {s24-s30}
        vmla.f32 s\z0, s24, s\q0
        vmla.f32 s\z1, s25, s\q1
        vmla.f32 s\z2, s26, s\q2
        vmla.f32 s\z3, s27, s\q3
        vmla.f32 s\z4, s28, s\q4
        vmla.f32 s\z5, s29, s\q5
        vmla.f32 s\z6, s30, s\q6
        .endm

        @ One output's lane sum in s19: from +0, unit by unit. r4 is 0.
        .macro  lane_sum
        vmov    s19, r4
        vldmia  r0!, {s20-s31}
        vmla.f32 s19, s20, s0
        vmla.f32 s19, s21, s1
        vmla.f32 s19, s22, s2
        vmla.f32 s19, s23, s3
        vmla.f32 s19, s24, s4
        vmla.f32 s19, s25, s5
        vmla.f32 s19, s26, s6
        vmla.f32 s19, s27, s7
        vmla.f32 s19, s28, s8
        vmla.f32 s19, s29, s9
        vmla.f32 s19, s30, s10
        vmla.f32 s19, s31, s11
        vldmia  r0!, {s20-s26}
        vmla.f32 s19, s20, s12
        vmla.f32 s19, s21, s13
        vmla.f32 s19, s22, s14
        vmla.f32 s19, s23, s15
        vmla.f32 s19, s24, s16
        vmla.f32 s19, s25, s17
        vmla.f32 s19, s26, s18
        .endm

        .section .text.hae_m4f_f32, "ax", %progbits
        .global hae_m4f_f32
        .type   hae_m4f_f32, %function
        .p2align 2
        .thumb_func
hae_m4f_f32:
        push    {r4-r11, lr}
        vpush   {s16-s31}
        sub     sp, #.Lhae_FRAME
        strd    r1, r2, [sp, #.Lhae_Q]        @ Q, Y
        str     r3, [sp, #.Lhae_SUMS]
        ldrd    r4, r5, [sp, #.Lhae_ARGUMENTS]
        movs    r6, #5
        udiv    r7, r4, r6
        mls     r6, r7, r6, r4
        strd    r7, r6, [sp, #.Lhae_CHUNKS]   @ CHUNKS, REST
        str     r5, [sp, #.Lhae_OUTPUTS]
        movs    r5, #0
.Lhae_lane:
        str     r5, [sp, #.Lhae_LANE]
        ldr     r1, [sp, #.Lhae_Q]
        ldrd    r3, r4, [sp, #.Lhae_CHUNKS]
        vldmia  r0!, {s0-s18}           @ z = b1
        cmp     r3, #0
        beq.w   2f

1:      @ five inputs, 95 weights
        vldmia  r1!, {s19-s23}
        take8   0,19, 1,19, 2,19, 3,19, 4,19, 5,19, 6,19, 7,19
        take8   8,19, 9,19, 10,19, 11,19, 12,19, 13,19, 14,19, 15,19
        take8   16,19, 17,19, 18,19, 0,20, 1,20, 2,20, 3,20, 4,20
        take8   5,20, 6,20, 7,20, 8,20, 9,20, 10,20, 11,20, 12,20
        take8   13,20, 14,20, 15,20, 16,20, 17,20, 18,20, 0,21, 1,21
        take8   2,21, 3,21, 4,21, 5,21, 6,21, 7,21, 8,21, 9,21
        take8   10,21, 11,21, 12,21, 13,21, 14,21, 15,21, 16,21, 17,21
        take8   18,21, 0,22, 1,22, 2,22, 3,22, 4,22, 5,22, 6,22
        take8   7,22, 8,22, 9,22, 10,22, 11,22, 12,22, 13,22, 14,22
        take8   15,22, 16,22, 17,22, 18,22, 0,23, 1,23, 2,23, 3,23
        take8   4,23, 5,23, 6,23, 7,23, 8,23, 9,23, 10,23, 11,23
        take7   12,23, 13,23, 14,23, 15,23, 16,23, 17,23, 18,23
        subs    r3, #1
        bne.w   1b

2:      @ the inputs that are left, one at a time
        cbz     r4, 4f
3:      vldmia  r1!, {s19}
        vldmia  r0!, {s20-s31}
        vmla.f32 s0, s20, s19
        vmla.f32 s1, s21, s19
        vmla.f32 s2, s22, s19
        vmla.f32 s3, s23, s19
        vmla.f32 s4, s24, s19
        vmla.f32 s5, s25, s19
        vmla.f32 s6, s26, s19
        vmla.f32 s7, s27, s19
        vmla.f32 s8, s28, s19
        vmla.f32 s9, s29, s19
        vmla.f32 s10, s30, s19
        vmla.f32 s11, s31, s19
        vldmia  r0!, {s20-s26}
        vmla.f32 s12, s20, s19
        vmla.f32 s13, s21, s19
        vmla.f32 s14, s22, s19
        vmla.f32 s15, s23, s19
        vmla.f32 s16, s24, s19
        vmla.f32 s17, s25, s19
        vmla.f32 s18, s26, s19
        subs    r4, #1
        bne.w   3b

4:      @ relu on the bits: a set sign clears the word, so that -0 becomes +0
        vstmia  sp, {s0-s18}
        ldm     sp, {r3-r12}
        bic     r3, r3, r3, asr #31
        bic     r4, r4, r4, asr #31
        bic     r5, r5, r5, asr #31
        bic     r6, r6, r6, asr #31
        bic     r7, r7, r7, asr #31
        bic     r8, r8, r8, asr #31
        bic     r9, r9, r9, asr #31
        bic     r10, r10, r10, asr #31
        bic     r11, r11, r11, asr #31
        bic     r12, r12, r12, asr #31
        stm     sp, {r3-r12}
        add     lr, sp, #40
        ldm     lr, {r3-r11}
        bic     r3, r3, r3, asr #31
        bic     r4, r4, r4, asr #31
        bic     r5, r5, r5, asr #31
        bic     r6, r6, r6, asr #31
        bic     r7, r7, r7, asr #31
        bic     r8, r8, r8, asr #31
        bic     r9, r9, r9, asr #31
        bic     r10, r10, r10, asr #31
        bic     r11, r11, r11, asr #31
        stm     lr, {r3-r11}
        vldmia  sp, {s0-s18}

        ldr     r5, [sp, #.Lhae_LANE]
        ldr     r2, [sp, #.Lhae_SUMS]
        ldr     r3, [sp, #.Lhae_OUTPUTS]
        movs    r4, #0
        add     r5, #1
        cmp     r5, #8
        bhi     6f
        add     r2, r2, r5, lsl #2      @ one float past this lane's
5:      @ lanes 0-7: store
        lane_sum
        vstr    s19, [r2, #-4]
        add     r2, #32
        subs    r3, #1
        bne     5b
        b       .Lhae_lane

6:      add     r2, r2, r5, lsl #2
7:      @ lanes 8-15: add to lane - 8
        lane_sum
        vldr    s20, [r2, #-36]
        vadd.f32 s19, s20, s19
        vstr    s19, [r2, #-36]
        add     r2, #32
        subs    r3, #1
        bne     7b
        cmp     r5, #16
        bne     .Lhae_lane

        @ the rest of the halving tree, and b2
        ldrd    r2, r3, [sp, #.Lhae_Y]        @ Y, SUMS
        ldr     r4, [sp, #.Lhae_OUTPUTS]
8:      vldmia  r3!, {s0-s7}
        vadd.f32 s0, s0, s4
        vadd.f32 s1, s1, s5
        vadd.f32 s2, s2, s6
        vadd.f32 s3, s3, s7
        vadd.f32 s0, s0, s2
        vadd.f32 s1, s1, s3
        vadd.f32 s0, s0, s1
        vldmia  r0!, {s8}
        vadd.f32 s0, s0, s8
        vstmia  r2!, {s0}
        subs    r4, #1
        bne     8b

        add     sp, #.Lhae_FRAME
        vpop    {s16-s31}
        pop     {r4-r11, pc}
        .size   hae_m4f_f32, . - hae_m4f_f32
